// Requests to the API of the web process.

const WITHIN = 12000; // ms; the server itself gives up after 10 s

/** A request that was not answered as it was asked; "status" 0: not answered at all. */
export class Problem extends Error {}

const problem = (words, status, reason) => Object.assign(new Problem(words), { status, reason });

/**
 * Send a request. Return the JSON of the answer, null if it has none. Throw Problem.
 * @param {string} method
 * @param {string} path below /api/v1
 * @param {any} [body]
 * @param {{key?: string, within?: number}} [options] "key" makes a submission safe to repeat
 */
export async function request(method, path, body, { key, within = WITHIN } = {}) {
  let answer;
  try {
    answer = await fetch(`/api/v1${path}`, {
      method, cache: "no-store", body: JSON.stringify(body), signal: AbortSignal.timeout(within),
      headers: { "content-type": "application/json", ...(key && { "idempotency-key": key }) },
    });
    if (answer.ok) return answer.status === 204 ? null : await answer.json(); // its end may be missing, too
  } catch (error) {
    throw problem(error.name === "TimeoutError" ? `no answer within ${within / 1000} s` : "the web process cannot be reached", 0);
  }
  const { detail, reason } = await answer.json().catch(() => ({})); // of something in between
  throw problem(detail ?? `answer ${answer.status}`, answer.status, reason);
}

export const get = (path, options) => request("GET", path, undefined, options);
export const post = (path, body, options) => request("POST", path, body, options);

/** A new idempotency key: the same request may be sent again with it. */
export const newKey = () => crypto.getRandomValues(new Uint32Array(4)).join("-");

/** What to tell a person of a failure. */
export function failureWords(error) {
  if (!(error instanceof Problem)) throw error;
  if (error.reason === "stale") return "Something halted the rover after this page was drawn. Look at it again, then repeat this if you still mean it.";
  return sentence(error.message.replace("goals[0].", "")); // the page sends one goal
}

/** Words with a capital letter. */
export const sentence = (words) => words.charAt(0).toUpperCase() + words.slice(1);
