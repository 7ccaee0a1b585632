// Where a token is required: asks for it, and goes on.

import { post } from "./api.js";
import { ask } from "./dialogs.js";
import { h } from "./dom.js";

/** Ask for a token; call "then" when it was accepted. */
export function logIn(then) {
  ask({
    title: "Log in", word: "Log in", isNeeded: true,
    words: ["This page needs a token. An administrator makes one with: mav-tasks keys add NAME --role operator"],
    fields: h("div", {}, h("input", { class: "quiet", type: "text", name: "username", autocomplete: "username", tabIndex: -1, "aria-hidden": "true" }), h("label", { class: "fields" }, "Token", h("input", { name: "token", type: "password", autocomplete: "current-password", required: true }))),
    act: async (form) => {
      await post("/session", { token: String(new FormData(form).get("token")).trim() });
      setTimeout(then);
    },
  });
}
