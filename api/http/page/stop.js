"use strict";
// The way to a stop: a process of its own on a port of its own, so that a busy, stopped or dead service does not matter.
// The service is asked as well; whichever answers first for the loop confirms.
const CONFIRM_MS = 1500;
const STOP_NAMES = { estop: "Emergency stop", pain: "Pain stop" };
let stopPort = 0;

async function learnStopPort() {
  const info = await (await fetch("/api/v1/info")).json();
  stopPort = info.stop_port || stopPort;
}

async function askForStop(url, signal) {
  const answer = await (await fetch(url, { method: "POST", signal })).json();
  if (answer.confirmed === true) return `${answer.done} (stop ${answer.id}, ${answer.after_ms} ms)`;
  if (answer.done === true) return answer.detail;
  throw new Error(answer.done || answer.detail);
}

function showStop(kind, text) {
  const banner = document.getElementById("stop-banner");
  banner.hidden = false;
  banner.className = kind;
  banner.textContent = text;
}

async function pressStop(kind) {
  const signal = AbortSignal.timeout(CONFIRM_MS), name = STOP_NAMES[kind];
  showStop("pending", `${name}: pending, waiting for the loop to confirm`);
  const ways = [askForStop(`/api/v1/${kind}`, signal)];
  if (stopPort) ways.unshift(askForStop(`http://127.0.0.1:${stopPort}/${kind}`, signal));
  try {
    showStop("confirmed", `${name}: confirmed by the loop: ${await Promise.any(ways)}`);
  } catch (error) {
    const why = error.errors.map((one) => one.message).join("; ");
    showStop("unconfirmed", `${name}: NOT CONFIRMED: use the hardware stop (${why})`);
  }
}

document.getElementById("estop").addEventListener("click", () => pressStop("estop"));
document.getElementById("pain").addEventListener("click", () => pressStop("pain"));
// Escape stops from wherever the focus is, also out of a dialog or a field.
window.addEventListener("keydown", (event) => {
  if (event.key === "Escape" && !event.repeat) pressStop("estop");
}, { capture: true });
learnStopPort().catch(() => {});
