// What the bench does now and did in the last minutes.
import { signal } from "@preact/signals";
import { Card, Dot, shown } from "../parts/basics";
import { retract } from "../parts/attention";
import { Happened } from "../parts/happened";
import { fresh, now_s, numbers, rig, traces } from "../live";
import { TimePlot, TimeWindow, XYPlot } from "../plot";
import { may } from "../session";
import { t } from "../texts";
import { columns } from "../trace";

const span_s = signal(30);
const cursor = signal<number | null>(null);
const shownTime = new TimeWindow(span_s, now_s);

const FORCE = [
  { trace: traces.force, label: t.values.force, unit: "N", colour: "--force" },
  { trace: traces.setpoint, label: t.values.setpoint, unit: "N", colour: "--setpoint", dash: [6, 4] },
  { trace: traces.error, label: t.values.error, unit: "N", colour: "--error" },
];
const DEPTH = [
  { trace: traces.depth, label: t.values.depth, unit: "mm", colour: "--depth" },
  { trace: traces.marker, label: t.values.marker, unit: "mm", colour: "--marker", dash: [6, 4] },
];

function Value({ id, label, value, unit, kind = "" }: { id: string; label: string; value: string; unit: string; kind?: "main" | "word" | "" }) {
  return (
    <div class={`value ${kind}`}>
      <dt>{label}</dt>
      <dd><output id={id}>{value}</output>{unit && <span> {unit}</span>}</dd>
    </div>
  );
}

function Values() {
  const now = numbers.value;
  return (
    <dl class={fresh.value ? "values" : "values stale"} aria-label={t.values.label}>
      <Value kind="main" id="force" label={t.values.force} value={shown(now.force)} unit="N" />
      <Value kind="main" id="depth" label={t.values.depth} value={shown(now.depth)} unit="mm" />
      <Value id="setpoint" label={t.values.setpoint} value={shown(now.setpoint)} unit="N" />
      <Value id="error" label={t.values.error} value={shown(now.error)} unit="N" />
      <Value id="marker" label={t.values.marker} value={shown(now.marker)} unit="mm" />
      <Value id="position" label={t.values.position} value={shown(now.position)} unit="mm" />
      <Value kind="word" id="mode" label={t.values.mode} value={fresh.value ? (t.modes[rig.value?.mode ?? ""] ?? rig.value?.mode ?? t.unknown) : t.unknown} unit="" />
    </dl>
  );
}

function AtCursor() {
  const time_s = cursor.value;
  if (time_s === null) return <p class="quiet readout">{t.bench.help} {t.bench.marker}</p>;
  const of = [...FORCE, ...DEPTH].map((line) => `${line.label} ${shown(line.trace.value(time_s), 3)} ${line.unit}`);
  return <p class="readout">{of.join(" · ")}</p>;
}

function Tools() {
  const paused = shownTime.fixed.value !== null;
  return (
    <div class="row tools">
      <button type="button" id="plot-pause" aria-pressed={paused} onClick={() => (paused ? shownTime.follow() : shownTime.pause())}>{paused ? t.bench.follow : t.bench.pause}</button>
      <button type="button" id="zoom-in" onClick={() => shownTime.zoom(0.5)}>{t.bench.zoomIn}</button>
      <button type="button" id="zoom-out" onClick={() => shownTime.zoom(2)}>{t.bench.zoomOut}</button>
      <button type="button" onClick={() => shownTime.move(-0.5)}>{t.bench.earlier}</button>
      <button type="button" onClick={() => shownTime.move(0.5)}>{t.bench.later}</button>
      <label class="inline">{t.bench.span}
        <select id="span" value={span_s.value} onChange={(event) => { span_s.value = Number(event.currentTarget.value); shownTime.follow(); }}>
          {Object.entries(t.bench.spans).map(([seconds, text]) => <option key={seconds} value={seconds}>{text}</option>)}
        </select>
      </label>
    </div>
  );
}

const KINDS: Record<string, "good" | "warn" | "bad"> = { ok: "good", degraded: "warn", connecting: "warn", reconnecting: "warn" };

function Health() {
  const now = rig.value;
  const devices = Object.entries(now?.devices ?? {});
  return (
    <Card title={t.bench.health}>
      {!devices.length && <p class="quiet">{t.bench.noDevices}</p>}
      <ul class={fresh.value ? "plain" : "plain stale"} id="health">
        {devices.map(([role, device]) => (
          <li key={role}>
            <Dot kind={KINDS[device.state ?? ""] ?? "bad"} />
            <span><strong>{t.devices.roles[role] ?? role}</strong> {t.bench.healthWord[device.state ?? ""] ?? device.state}{device.state !== "ok" && device.detail ? `: ${device.detail}` : ""}</span>
          </li>
        ))}
      </ul>
      <p id="loop" class="quiet">{t.bench.loop(now?.cycles ?? 0, now?.missed ?? 0)}</p>
      <button id="retract" type="button" disabled={now?.state !== "idle" || !fresh.value || !may("operate")} title={t.attention.retractHint} onClick={retract}>{t.attention.retract}</button>
    </Card>
  );
}

function loop() {
  const [from, to] = shownTime.span;
  const [, force, depth] = columns([traces.force, traces.depth], from, to, 600);
  const both = force!.map((value, i) => [depth![i], value] as const).filter(([x, y]) => x != null && y != null);
  return [{ x: both.map(([x]) => x!), y: both.map(([, y]) => y!), label: t.values.force, colour: "--force" }];
}

export function Bench() {
  return (
    <>
      <h1 class="visually-hidden">{t.bench.title}</h1>
      <Values />
      {fresh.value && rig.value?.state === "idle" && numbers.value.force === null && <p id="unzeroed" class="quiet">{t.bench.unzeroed}</p>}
      <div class={fresh.value ? "grid bench" : "grid bench stale"}>
        <section class="card history" aria-label={t.bench.forcePlot}>
          <Tools />
          <TimePlot id="force-plot" label={t.bench.forcePlot} unit="N" lines={FORCE} window={shownTime} height={250} cursor={cursor} />
          <TimePlot id="depth-plot" label={t.bench.depthPlot} unit="mm" lines={DEPTH} window={shownTime} height={190} cursor={cursor} />
          <AtCursor />
        </section>
        <Card title={t.bench.against}>
          <XYPlot id="loop-plot" label={t.bench.loopPlot} xUnit="mm" unit="N" curves={loop} height={250} every_ms={200} />
        </Card>
        <Health />
        <Happened />
      </div>
    </>
  );
}
