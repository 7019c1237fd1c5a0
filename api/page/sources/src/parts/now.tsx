// Force as it is now, large, beside what was asked for.
import { signal } from "@preact/signals";
import { fresh, now_s, numbers, traces } from "../live";
import { TimePlot, TimeWindow } from "../plot";
import { t } from "../texts";
import { shown } from "./basics";

const span_s = signal(20);
const cursor = signal<number | null>(null);
const window_ = new TimeWindow(span_s, now_s);
const LINES = [
  { trace: traces.force, label: t.values.force, unit: "N", colour: "--force" },
  { trace: traces.setpoint, label: t.values.setpoint, unit: "N", colour: "--setpoint", dash: [6, 4] },
  { trace: traces.error, label: t.values.error, unit: "N", colour: "--error" },
];

type Named = "force" | "setpoint" | "error" | "depth";
const UNITS: Record<Named, string> = { force: "N", setpoint: "N", error: "N", depth: "mm" };

export function Now({ of }: { of: Named[] }) {
  return (
    <dl class={fresh.value ? "facts large" : "facts large stale"} aria-label={t.values.label}>
      {of.map((name) => (
        <div key={name}>
          <dt>{t.values[name]}</dt>
          <dd><output id={`now-${name}`}>{shown(numbers.value[name])}</output> <small>{UNITS[name]}</small></dd>
        </div>
      ))}
    </dl>
  );
}

export function ForceNow({ height = 220 }: { height?: number }) {
  return (
    <div class={fresh.value ? "" : "stale"}>
      <TimePlot id="force-now" label={t.bench.forcePlot} unit="N" lines={LINES} window={window_} height={height} cursor={cursor} />
    </div>
  );
}
