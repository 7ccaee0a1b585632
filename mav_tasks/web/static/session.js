// Who I am, and what the web process offers: read at first, and after each reconnect, because it may be another one.

import { get } from "./api.js";
import { h, say, show } from "./dom.js";
import { change, state } from "./store.js";

const news = document.getElementById("news");
const words = h("span", { role: "status" });
let first = null; // of the process that this page came from

/** Read the session again; throw Problem. */
export async function read() {
  const session = await get("/session");
  if (!first) begin(session);
  const isOther = JSON.stringify(session) !== JSON.stringify(state.session);
  state.session = session;
  if (!isOther) return;
  const all = changes(session);
  say(words, all.length ? `${all.join(" ")} To use what is new, load this page again; what you have typed into it is lost.` : "");
  show(news, all.length > 0);
  change("session");
}

function begin(session) {
  first = session;
  news.append(words, h("button", { class: "small", type: "button", onclick: () => location.reload() }, "Load again"));
}

// what this page cannot take over: its files are those of the first process, and so are the hosts that it may ask
function changes(session) {
  const found = [];
  if (session.version !== first.version) found.push(`The web process has version ${session.version} now, this page has version ${first.version}.`);
  if (JSON.stringify(session.tiles) !== JSON.stringify(first.tiles)) found.push("The web process has other map tiles now.");
  return found;
}
