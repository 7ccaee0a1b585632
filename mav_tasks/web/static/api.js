// Requests to the API of the web process.

const ROOT = "/api/v1";
const WITHIN = 12000; // ms; the server itself gives up after 10 s

/** A request that was not answered as it was asked. */
export class Problem extends Error {
  constructor(status, detail, reason) {
    super(detail);
    this.status = status;
    this.reason = reason;
  }
}

/**
 * Send a request. Return the JSON of the answer, null if it has none. Throw Problem.
 * @param {string} method
 * @param {string} path below /api/v1
 * @param {any} [body]
 * @param {{key?: string, within?: number}} [options] "key" makes a submission safe to repeat
 */
export async function request(method, path, body, { key, within = WITHIN } = {}) {
  const headers = {};
  if (body !== undefined) headers["content-type"] = "application/json";
  if (key) headers["idempotency-key"] = key;
  let answer;
  try {
    answer = await fetch(ROOT + path, {
      method, headers, cache: "no-store", credentials: "same-origin",
      body: body === undefined ? undefined : JSON.stringify(body),
      signal: AbortSignal.timeout(within),
    });
    if (answer.ok) return answer.status === 204 ? null : await answer.json(); // its end may be missing, too
  } catch (error) {
    const words = error.name === "TimeoutError" ? `no answer within ${within / 1000} s` : "the web process cannot be reached";
    throw new Problem(0, words, null);
  }
  const problem = await answer.json().catch(() => ({})); // of something in between
  throw new Problem(answer.status, problem.detail ?? `answer ${answer.status}`, problem.reason ?? null);
}

export const get = (path, options) => request("GET", path, undefined, options);
export const post = (path, body, options) => request("POST", path, body, options);

/** A new idempotency key: the same request may be sent again with it. */
export function newKey() {
  return Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** What to tell a person of a failure. */
export function failureWords(error) {
  if (!(error instanceof Problem)) throw error;
  if (error.reason === "stale") return "Something halted the rover after this page was drawn. Look at it again, then repeat this if you still mean it.";
  const words = error.message.replace("goals[0].", ""); // the page sends one goal
  return words.charAt(0).toUpperCase() + words.slice(1);
}
