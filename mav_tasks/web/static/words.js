// Times, distances and states in words; tasks by their names.

import { h } from "./dom.js";
import { showTask } from "./store.js";

/** "3 s", "2 min", "1 h 5 min" */
export function duration(seconds) {
  const whole = Math.max(0, Math.round(seconds));
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min${whole % 60 && whole < 600 ? ` ${whole % 60} s` : ""}`;
  const [unit, rest, large, small] = whole < 86400 ? [3600, 60, "h", "min"] : [86400, 3600, "d", "h"];
  const left = Math.floor((whole % unit) / rest);
  return `${Math.floor(whole / unit)} ${large}${left ? ` ${left} ${small}` : ""}`;
}

/** Milliseconds below a second, else seconds with a decimal. */
export const quick = (seconds) => (seconds < 1 ? `${Math.round(seconds * 1000)}\u00a0ms` : `${seconds.toFixed(1)}\u00a0s`);

/** The local time of seconds since 1970; of another day with its date. */
export function clock(seconds) {
  const at = new Date(seconds * 1000);
  const time = at.toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", second: "2-digit" });
  return at.toDateString() === new Date().toDateString() ? time : `${at.toLocaleDateString([], { day: "numeric", month: "short" })} ${time}`;
}

/** "1 task", "2 tasks" */
export const counted = (count, what) => `${count} ${what}${count === 1 ? "" : "s"}`;

/** Those of the parts that there are. */
export const joined = (...parts) => parts.filter(Boolean).join(" · ");

/** When a task ended, seconds since 1970. */
export const endedAt = (task) => Date.parse(task.ended_at) / 1000;

// beside the word of a state, so that colour is not needed to tell them apart
const MARKS = {
  scheduled: "◷", blocked: "◇", queued: "○", starting: "◔", executing: "▶", paused: "❚❚", cancelling: "◌", held: "⚠",
  completed: "✓", failed: "✗", cancelled: "–", killed: "■", expired: "⌛", unknown: "?",
};
export const WAITING = ["scheduled", "blocked", "queued"];
export const ACTIVE = ["starting", "executing", "paused", "cancelling", "held"];
export const OVER = ["completed", "failed", "cancelled", "killed", "expired"];

/** "▶ executing" */
export const stateWords = ({ state }) => `${MARKS[state] ?? ""} ${state}`;

/** How far a task is: "1.2 m left, 40 %, ends in 3 s". */
export const progressWords = (task) => joined(
  task.left !== null && `${task.left.toFixed(task.left_unit === "items" ? 0 : 1)} ${task.left_unit} left`,
  task.progress !== null && `${Math.round(task.progress * 100)} %`,
  task.items > 1 && `item ${task.item} of ${task.items}`,
  task.time_to_finish !== null && `ends in ${duration(task.time_to_finish)}`,
);

/** The name of a task: "Task 12 “to the gate”: move 2 m". */
export const taskName = (task) => `Task ${task.id}${task.label ? ` “${task.label}”` : ""}: ${task.what}`;

/** A link to a task, which opens without loading the page again. */
export function taskLink(id, words) {
  const onclick = (event) => {
    if (event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    showTask(id);
  };
  return h("a", { href: `/tasks/${id}`, onclick }, words);
}

const COLOURS = ["#0b84a5", "#d1602d", "#6a4fb3", "#2f8f4e", "#b3468a", "#8a6d00", "#3b6fd4", "#a23b3b"];

/** One of a fixed set of colours for each task. */
export const taskColour = (task) => (task === null ? "#8a9693" : COLOURS[task % COLOURS.length]);
