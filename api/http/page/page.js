"use strict";
// Shows what the service says and asks it to act; keeps no state of its own beyond what is on the screen.
const API = "/api/v1";
const at = (id) => document.getElementById(id);
const opened = new Date().toLocaleTimeString();
const plot = new Plot(at("plot"));
const RENEW_MS = 1000;
// Twenty missed views in a row; a busy computer holds one back for a few tenths of a second.
const SILENCE_MS = 1000;
let heard_ms = Date.now();
let lastState = "";
let job = null;
let lease = null;
let renewed_ms = 0;

async function call(method, path, body) {
  const headers = { ...(body && { "Content-Type": "application/json" }), ...(lease && { "X-Control-Lease": lease }) };
  const response = await fetch(API + path, { method, headers, body: body && JSON.stringify(body) });
  const answer = await response.json();
  if (!response.ok) throw new Error(answer.detail || response.statusText);
  return answer;
}

async function attempt(action) {
  try {
    const said = await action();
    at("message").textContent = typeof said === "string" ? said : "";
  } catch (error) {
    at("message").textContent = error.message;
  }
}

// Whatever moves needs the lease: one page at a time, for as long as it shows itself.
async function inControl(action) {
  if (!lease) lease = (await call("POST", "/control/lease", { holder: `page opened ${opened}` })).lease_id;
  return action();
}

async function renew() {
  if (!lease || Date.now() - renewed_ms < RENEW_MS) return;
  renewed_ms = Date.now();
  try {
    await call("PUT", "/control/lease");
  } catch (error) {
    lease = null;
    at("message").textContent = error.message;
  }
}

async function release() {
  await call("DELETE", "/control/lease");
  lease = null;
}

const number = (value, digits) => (value === null || value === undefined ? "--" : value.toFixed(digits));

function show(rig) {
  at("state").textContent = rig.state;
  at("reason").hidden = !rig.reason;
  at("reason").textContent = rig.reason;
  at("force").textContent = number(rig.force_N, 2);
  at("depth").textContent = number(rig.depth_mm, 2);
  at("position").textContent = number(rig.position_mm, 2);
  at("mode").textContent = rig.mode || "--";
  at("reset").hidden = rig.state !== "stopped";
  at("reset").disabled = Boolean(rig.job);
  at("retract").disabled = rig.state !== "idle";
  at("connect").hidden = rig.state !== "disconnected";
  at("recover").hidden = rig.state === "idle" || rig.state === "running";
  at("loop").textContent = `loop: ${rig.cycles} cycles, ${rig.missed} missed`;
  const mine = lease ? " (this page)" : "";
  at("control").textContent = rig.control.holder ? `in control: ${rig.control.holder}${mine}` : "nobody is in control";
  at("release").hidden = !lease || rig.state === "running";
  renew();
  showDevices(rig);
  showJob(rig.job);
  plot.add(rig.time_ns * 1e-9, rig.force_N, rig.depth_mm);
  if (lastState === "running" && rig.state !== "running") loadRecordings();
  lastState = rig.state;
}

function cell(text, kind) {
  const element = document.createElement("td");
  element.textContent = text;
  if (kind) element.className = kind;
  return element;
}

function showDevices(rig) {
  const roles = { force: "force", axis: "axis", marker: "tracker" };
  const rows = Object.entries(roles).filter(([, role]) => rig.devices[role]).map(([stream, role]) => {
    const row = document.createElement("tr"), health = rig.health[stream];
    const device = rig.devices[role], state = cell(device.state || "--", device.state === "ok" ? "yes" : "no");
    state.title = device.detail || "";
    row.append(cell(stream), cell(device.product), state);
    for (const bit of ["alive", "valid", "on_rate"]) row.append(cell(health[bit] ? "yes" : "NO", health[bit] ? "yes" : "no"));
    row.append(cell(number(rig.rates_Hz[stream], 0)));
    return row;
  });
  at("devices").replaceChildren(...rows);
}

function showJob(now) {
  job = now;
  at("job").hidden = !now;
  at("start").querySelector("button").disabled = Boolean(now) || lastState !== "idle";
  if (!now) return;
  at("job-text").textContent = `${now.name}: ${now.message} (${now.done} of ${now.total} ${now.unit})`;
  at("job-bar").max = now.total;
  at("job-bar").value = now.done;
}

async function loadProtocols() {
  const options = (await call("GET", "/protocols")).map((protocol) => {
    const option = document.createElement("option");
    option.value = protocol.name;
    option.textContent = protocol.refusal ? `${protocol.name} (refused: ${protocol.refusal})` : protocol.name;
    option.disabled = Boolean(protocol.refusal);
    return option;
  });
  at("protocol").replaceChildren(...options);
}

async function loadRecordings() {
  const sessions = await call("GET", "/recordings");
  if (!sessions.length) return;
  at("recordings").replaceChildren(...sessions.map((session) => {
    const details = document.createElement("details"), summary = document.createElement("summary");
    const count = session.trials === 1 ? "1 recording" : `${session.trials} recordings`;
    summary.textContent = `${session.name}: ${count}, ${session.samples} samples, ${session.dropped} dropped`;
    const list = document.createElement("ul");
    list.append(...session.recordings.map((file) => {
      const item = document.createElement("li"), link = document.createElement("a");
      link.href = file.href;
      link.textContent = `${file.file} (${(file.bytes / 1e6).toFixed(2)} MB)`;
      item.append(link);
      return item;
    }));
    details.append(summary, list);
    return details;
  }));
}

// A service that was stopped or hangs keeps its connection open and says nothing: only the clock tells.
function showSilence() {
  if (Date.now() - heard_ms < SILENCE_MS) return;
  lastState = "unknown";
  document.body.classList.add("stale");
  at("state").textContent = "no answer from the service";
  at("reason").hidden = false;
  at("reason").textContent = "The service does not answer: nothing shown here is true any more. STOP still works. Use the hardware stop if in doubt.";
  for (const id of ["force", "depth", "position", "mode"]) at(id).textContent = "--";
  at("start").querySelector("button").disabled = true;
}

function listen() {
  const source = new EventSource(`${API}/live`);
  source.onopen = () => learnStopPort().catch(() => {});
  source.onmessage = (event) => {
    heard_ms = Date.now();
    document.body.classList.remove("stale");
    show(JSON.parse(event.data));
  };
  setInterval(showSilence, SILENCE_MS / 4);
}

function askConsent(told, question) {
  const dialog = at("recovery");
  at("recovery-told").replaceChildren(...told.map((line) => Object.assign(document.createElement("li"), { textContent: line })));
  at("recovery-question").textContent = question;
  dialog.returnValue = "no";
  dialog.showModal();
  return new Promise((resolve) => dialog.addEventListener("close", () => resolve(dialog.returnValue === "yes"), { once: true }));
}

// The service says what happened and what it needs consent for; nothing is done that was not agreed to by itself.
async function recover() {
  const consent = {};
  for (;;) {
    const found = await call("POST", "/recover", consent);
    if (!found.open.length) return found.ready ? `recovered: ${found.done.join("; ") || "nothing had to be done"}` : `recovered, but ${found.missing}`;
    const { act, question } = found.open[0];
    if (!(await askConsent(found.happened, question))) return "not recovered: no consent was given";
    consent[act] = true;
  }
}

function suggestSession() {
  const now = new Date(), two = (n) => String(n).padStart(2, "0");
  at("session").value = `${now.getFullYear()}${two(now.getMonth() + 1)}${two(now.getDate())}-${two(now.getHours())}${two(now.getMinutes())}${two(now.getSeconds())}`;
}

at("job-stop").addEventListener("click", () => attempt(() => call("POST", `/jobs/${job.id}/stop`)));
at("reset").addEventListener("click", () => attempt(() => inControl(async () => (await call("POST", "/estop/reset")).detail)));
at("retract").addEventListener("click", () => attempt(() => inControl(async () => { await call("POST", "/jobs", { kind: "retract" }); return "retracting"; })));
at("connect").addEventListener("click", () => attempt(() => inControl(() => call("POST", "/rig/connect"))));
at("recover").addEventListener("click", () => attempt(() => inControl(recover)));
at("release").addEventListener("click", () => attempt(release));
window.addEventListener("pagehide", () => {
  if (lease) fetch(`${API}/control/lease`, { method: "DELETE", headers: { "X-Control-Lease": lease }, keepalive: true });
});
at("start").addEventListener("submit", (event) => {
  event.preventDefault();
  const body = { kind: "capture", protocol: at("protocol").value, session: at("session").value };
  attempt(() => inControl(async () => { await call("POST", "/jobs", body); suggestSession(); return "started"; }));
});

(function frame() { plot.draw(); setTimeout(() => requestAnimationFrame(frame), 50); })();
suggestSession();
attempt(loadProtocols);
attempt(loadRecordings);
listen();
