// What was recorded, each recording a line: force against depth, or over time.
import { useMemo, useState } from "preact/hooks";
import { get, ifThere, type Schema } from "../../api";
import { useLoaded } from "../../loaded";
import { Card, Show } from "../../parts/basics";
import { XYPlot, type Curve } from "../../plot";
import { t } from "../../texts";

type View = Schema["CurveView"];
type Over = "depth" | "time";
interface Law {
  rows?: { force_N: number; predicted_mm: number }[];
}

const COLOURS: Record<string, string> = { bad: "--error", usable: "--depth" };

function line(curve: View, over: Over): Curve {
  const x = over === "time" ? curve.time_s : curve.depth_mm.map((value) => value ?? NaN);
  return { x, y: curve.force_N, label: curve.name, colour: COLOURS[curve.quality] ?? "--force", faint: true };
}

function fitted(fit: Record<string, unknown> | null): Curve[] {
  const rows = (fit?.[String(fit.model_law)] as Law | undefined)?.rows ?? [];
  if (!rows.length) return [];
  return [{ x: [0, ...rows.map((row) => row.predicted_mm)], y: [0, ...rows.map((row) => row.force_N)], label: t.session.model, colour: "--ink", dash: [6, 4] }];
}

function Lines({ curves, fit, over }: { curves: View[]; fit: Record<string, unknown> | null; over: Over }) {
  const drawn = useMemo(() => {
    const references = over === "time" ? curves.filter((one) => one.reference_N.length) : [];
    return [
      ...curves.map((one) => line(one, over)),
      ...references.map((one) => ({ x: one.time_s, y: one.reference_N, label: t.values.setpoint, colour: "--setpoint", dash: [6, 4] })),
      ...(over === "depth" ? fitted(fit) : []),
    ];
  }, [curves, fit, over]);
  const surface = curves.every((one) => one.from_surface);
  const [xLabel, unit] = over === "time" ? [t.session.time, "s"] : [surface ? t.session.depth : t.session.position, "mm"];
  return <XYPlot id="curves" label={t.session.curvesLabel(curves.length, xLabel)} xUnit={`${xLabel}, ${unit}`} unit="N" curves={() => drawn} height={360} on={[drawn]} />;
}

function Key({ curves, fit, over }: { curves: View[]; fit: boolean; over: Over }) {
  const kinds = [
    { colour: "--force", text: t.session.line.good, there: curves.some((one) => !COLOURS[one.quality]) },
    { colour: "--depth", text: t.session.line.usable, there: curves.some((one) => one.quality === "usable") },
    { colour: "--error", text: t.session.line.bad, there: curves.some((one) => one.quality === "bad") },
    { colour: "--setpoint", text: t.values.setpoint, there: over === "time" && curves.some((one) => one.reference_N.length), dashed: true },
    { colour: "--ink", text: t.session.model, there: fit && over === "depth", dashed: true },
  ];
  return (
    <p class="key-line quiet">{kinds.filter((one) => one.there).map((one) => (
      <span key={one.text}><i class={one.dashed ? "swatch dashed" : "swatch"} style={{ color: `var(${one.colour})` }} /> {one.text}</span>
    ))}</p>
  );
}

export function Curves({ of, on }: { of: string; on: string }) {
  const loaded = useLoaded(() => get("/api/v1/sessions/{session}/curves", { path: { session: of } }), [of]);
  const fit = useLoaded(() => ifThere<Record<string, unknown>>("/api/v1/recordings/{session}/fit/fit.json", { path: { session: of } }), [of, on]);
  const [wanted, want] = useState<Over | null>(null);
  return (
    <Card id="curves-card" title={t.session.curves} wide>
      <Show loaded={loaded}>
        {(found) => {
          const there = found.curves.filter((one) => one.force_N.length);
          if (!there.length) return <p class="quiet">{found.curves[0]?.problem ?? t.session.noCurves}</p>;
          const over = wanted ?? (there.every((one) => one.tracks_force) ? "time" : "depth");
          // A run that tracks a force says nothing as force against depth.
          const shown = over === "depth" ? there.filter((one) => !one.tracks_force) : there;
          return (
            <>
              <div class="row tools" role="group" aria-label={t.session.against}>
                {(["depth", "time"] as const).map((one) => <button key={one} id={`over-${one}`} type="button" aria-pressed={over === one} onClick={() => want(one)}>{t.session.over[one]}</button>)}
              </div>
              {shown.length ? <Lines curves={shown} fit={fit.value} over={over} /> : <p class="quiet">{t.session.onlyTracked}</p>}
              <Key curves={shown} fit={Boolean(fit.value)} over={over} />
              {found.left_out > 0 && <p class="quiet">{t.session.leftOut(found.left_out)}</p>}
            </>
          );
        }}
      </Show>
    </Card>
  );
}
