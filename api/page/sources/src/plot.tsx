// Traces against time or against each other, drawn by uPlot from the rings; zoom, cursor, pause.
import { signal, type Signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import { shown as number } from "./parts/basics";
import { t } from "./texts";
import { columns, type Trace } from "./trace";

export interface Line {
  trace: Trace;
  label: string;
  unit: string;
  colour: string;
  dash?: number[];
}

/** What part of the time is shown: the last ``span_s``, or ``fixed`` after a zoom or a pause. */
export class TimeWindow {
  readonly fixed: Signal<[number, number] | null> = signal(null);
  private paused_s = 0;
  constructor(
    readonly span_s: Signal<number>,
    readonly now_s: () => number,
  ) {}

  get span(): [number, number] {
    const now_s = this.zero_s;
    return this.fixed.value ?? [now_s - this.span_s.value, now_s];
  }

  /** The time that others are counted from: now, or when it was paused. */
  get zero_s(): number {
    return this.fixed.value ? this.paused_s : this.now_s();
  }

  show(span: [number, number]): void {
    this.paused_s = this.zero_s;
    this.fixed.value = span;
  }

  pause(): void {
    this.show(this.span);
  }

  follow(): void {
    this.fixed.value = null;
  }

  /** Shows ``share`` of what is shown, around its middle. */
  zoom(share: number): void {
    const [from, to] = this.span;
    const half = ((to - from) * share) / 2;
    this.show([(from + to) / 2 - half, (from + to) / 2 + half]);
  }

  /** Moves by ``share`` of what is shown. */
  move(share: number): void {
    const [from, to] = this.span;
    this.show([from + (to - from) * share, to + (to - from) * share]);
  }
}

const style = (name: string) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** The computed colour of a custom property: canvas does not know `light-dark()`. */
export function colour(name: string): string {
  const probe = document.createElement("span");
  probe.style.color = `var(${name})`;
  document.body.append(probe);
  const found = getComputedStyle(probe).color;
  probe.remove();
  return found;
}

function axes(unit: string, xUnit: string): uPlot.Axis[] {
  const plain = { stroke: colour("--quiet"), grid: { stroke: colour("--line"), width: 1 }, ticks: { stroke: colour("--line"), width: 1 }, font: `12px ${style("--font")}` };
  const values = (_: uPlot, splits: number[]) => splits.map((value) => String(+value.toFixed(6)).replace("-", "−"));
  return ([[30, xUnit], [50, unit]] as const).map(([size, label]) => ({ ...plain, size, label, values, labelSize: 16, labelFont: plain.font }));
}

// A plot that shows less than this is noise magnified.
const LEAST_SPAN: Record<string, number> = { N: 0.5, mm: 0.5, "N/mm": 0.05 };

function ranged(unit: string) {
  return (_: uPlot, low: number | null, high: number | null): [number, number] => {
    if (low === null || high === null || !Number.isFinite(low)) return [-0.1, 1];
    const missing = Math.max(0, (LEAST_SPAN[unit] ?? 0) - (high - low)) / 2;
    const margin = 0.08 * (high - low + 2 * missing);
    return [low - missing - margin, high + missing + margin];
  };
}

// A step of the cursor by a key, and a large one, as shares of the width.
const STEPS: Record<string, number> = { ArrowLeft: -0.01, ArrowRight: 0.01, PageDown: -0.1, PageUp: 0.1 };
// More than the eye needs of a line that moves along, and few enough to leave a computer of two cores to the loop.
const FRAMES_HZ = 40;

interface TimePlotProps {
  id: string;
  label: string;
  unit: string;
  lines: Line[];
  window: TimeWindow;
  height: number;
  cursor: Signal<number | null>;
}

/** Lines over one window of time; every frame draws the least and the greatest of each column of pixels. */
export function TimePlot({ id, label, unit, lines, window: shown, height, cursor }: TimePlotProps) {
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const box = place.current!;
    let plot: uPlot | null = null;
    let frame = 0;
    let due_ms = 0;
    let drawn = "";
    const time = (u: uPlot, left: number) => u.posToVal(left, "x") + shown.zero_s;
    // The cursor by keys, told as a slider's value is.
    const step = (event: KeyboardEvent) => {
      const share = STEPS[event.key];
      if (!plot || !share) return;
      event.preventDefault();
      const { clientWidth: width } = plot.over;
      const from = plot.cursor.left! >= 0 ? plot.cursor.left! : width;
      const left = Math.min(width, Math.max(0, from + share * width));
      plot.setCursor({ left, top: 0 });
      const at_s = time(plot, left);
      box.setAttribute("aria-valuenow", String(Math.round((100 * left) / width)));
      box.setAttribute("aria-valuetext", lines.map((line) => `${line.label} ${number(line.trace.value(at_s))} ${line.unit}`).join(", "));
    };
    const make = () => {
      drawn = "";
      plot?.destroy();
      plot = new uPlot(
        {
          width: box.clientWidth, height, legend: { show: false }, padding: [8, 12, 0, 0],
          cursor: { y: false, drag: { x: true, y: false, setScale: false }, sync: { key: "time" } },
          scales: { x: { time: false }, y: { range: ranged(unit) } },
          axes: axes(unit, t.plot.seconds),
          series: [{}, ...lines.map((line) => ({ label: line.label, stroke: colour(line.colour), width: 1, dash: line.dash, spanGaps: true, points: { show: false } }))],
          hooks: {
            setSelect: [(u) => {
              if (u.select.width < 4) return;
              shown.show([time(u, u.select.left), time(u, u.select.left + u.select.width)]);
              u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
            }],
            setCursor: [(u) => void (cursor.value = u.cursor.left != null && u.cursor.left >= 0 ? time(u, u.cursor.left) : null)],
          },
        },
        [[], ...lines.map(() => [])] as unknown as uPlot.AlignedData,
        box,
      );
      plot.over.addEventListener("dblclick", () => shown.follow());
    };
    const draw = (time_ms: number) => {
      frame = requestAnimationFrame(draw);
      if (!plot || !box.clientWidth || time_ms < due_ms) return;
      // In step with the clock, not with what was drawn late.
      due_ms = Math.max(due_ms + 1000 / FRAMES_HZ, time_ms - 1000 / FRAMES_HZ);
      const [from, to] = shown.span;
      const what = `${from} ${to} ${box.clientWidth}`;
      if (what === drawn) return;
      drawn = what;
      const zero_s = shown.fixed.value ? shown.zero_s : to;
      const [times, ...values] = columns(lines.map((line) => line.trace), from, to, Math.max(50, plot.over.clientWidth));
      plot.axes[0]!.label = shown.fixed.value ? t.plot.paused : t.plot.seconds;
      plot.batch(() => {
        plot!.setData([times.map((one) => one - zero_s), ...values] as unknown as uPlot.AlignedData, false);
        plot!.setScale("x", { min: from - zero_s, max: to - zero_s });
      });
    };
    make();
    box.addEventListener("keydown", step);
    const sized = new ResizeObserver(() => plot?.setSize({ width: box.clientWidth, height }));
    sized.observe(box);
    const dark = matchMedia("(prefers-color-scheme: dark)");
    dark.addEventListener("change", make);
    frame = requestAnimationFrame(draw);
    return () => {
      cancelAnimationFrame(frame);
      box.removeEventListener("keydown", step);
      dark.removeEventListener("change", make);
      sized.disconnect();
      plot?.destroy();
    };
  }, []);
  return (
    <figure class="plot">
      <figcaption>
        {lines.map((line) => (
          <span class="key" key={line.label}>
            <i class={line.dash ? "swatch dashed" : "swatch"} style={{ color: `var(${line.colour})` }} /> {line.label}, {line.unit}
          </span>
        ))}
      </figcaption>
      <div id={id} ref={place} class="canvas" role="slider" tabIndex={0} aria-label={label} aria-valuemin={0} aria-valuemax={100} aria-valuenow={100} aria-valuetext={t.plot.keys} style={{ height: `${height}px` }} />
    </figure>
  );
}

export interface Curve {
  x: ArrayLike<number>;
  y: ArrayLike<number | null>;
  label: string;
  colour: string;
  dash?: number[];
  points?: boolean;
  /** One of many, which lie over each other. */
  faint?: boolean;
}

/** Curves each with an x of its own, as force against depth; redrawn when ``curves()`` is asked again by ``every_ms``. */
export function XYPlot({ id, label, xUnit, unit, curves, height, every_ms = 0, on = [] }: { id: string; label: string; xUnit: string; unit: string; curves: () => Curve[]; height: number; every_ms?: number; on?: unknown[] }) {
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const box = place.current!;
    let plot: uPlot | null = null;
    const draw = () => {
      if (!box.clientWidth) return;
      const now = curves();
      const xs = now.map((curve) => Array.from(curve.x));
      const bounds = (): [number, number] => {
        let low = Infinity, high = -Infinity;
        // Where the surface is not known yet there is no depth, and nothing to span.
        for (const x of xs) for (const value of x) if (Number.isFinite(value)) { low = Math.min(low, value); high = Math.max(high, value); }
        return Number.isFinite(low) && high > low ? [low - 0.04 * (high - low), high + 0.04 * (high - low)] : [0, 1];
      };
      box.dataset.from = String(bounds()[0]);
      box.dataset.to = String(bounds()[1]);
      const data = [null, ...now.map((curve, i) => [xs[i], Array.from(curve.y)])] as unknown as uPlot.AlignedData;
      if (plot && plot.series.length === now.length + 1) {
        plot.setData(data);
        return;
      }
      plot?.destroy();
      plot = new uPlot(
        {
          mode: 2, width: box.clientWidth, height, legend: { show: false }, padding: [8, 12, 0, 0], cursor: { drag: { x: true, y: true } },
          scales: { x: { time: false, range: (u, low, high) => (u.data[0] === null && Number.isFinite(low) && low !== high ? [low, high] : bounds()) }, y: { range: ranged(unit) } },
          axes: axes(unit, xUnit),
          series: [{}, ...now.map((curve) => ({ label: curve.label, stroke: colour(curve.colour), dash: curve.dash, width: 1, paths: drawn(curve), facets: [{ scale: "x", auto: true }, { scale: "y", auto: true }] }))] as uPlot.Series[],
        },
        data,
        box,
      );
    };
    const make = () => { plot?.destroy(); plot = null; draw(); };
    draw();
    const sized = new ResizeObserver(() => (plot ? plot.setSize({ width: box.clientWidth, height }) : draw()));
    sized.observe(box);
    const timer = every_ms ? setInterval(draw, every_ms) : 0;
    const dark = matchMedia("(prefers-color-scheme: dark)");
    dark.addEventListener("change", make);
    return () => { clearInterval(timer); dark.removeEventListener("change", make); sized.disconnect(); plot?.destroy(); };
  }, on);
  return <div id={id} ref={place} class="canvas" role="img" aria-label={label} style={{ height: `${height}px` }} />;
}

/** uPlot has no line for curves that turn back, as a loop of force against depth does. */
function drawn(curve: Curve) {
  return (u: uPlot, series: number) => {
    const [x, y] = u.data[series] as unknown as [number[], (number | null)[]];
    const path = new Path2D();
    let down = false;
    for (let i = 0; i < x.length; i++) {
      const value = y[i];
      if (value === null || value === undefined || Number.isNaN(value) || !Number.isFinite(x[i])) { down = false; continue; }
      const px = u.valToPos(x[i]!, "x", true), py = u.valToPos(value, "y", true);
      if (curve.points) { path.moveTo(px + 2, py); path.arc(px, py, 2, 0, 7); }
      else if (down) path.lineTo(px, py);
      else path.moveTo(px, py);
      down = true;
    }
    u.ctx.save();
    u.ctx.beginPath();
    u.ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    u.ctx.clip();
    u.ctx.strokeStyle = colour(curve.colour);
    u.ctx.lineWidth = (curve.dash ? 2 : 1) * devicePixelRatio;
    u.ctx.globalAlpha = curve.faint ? 0.55 : 1;
    u.ctx.setLineDash((curve.dash ?? []).map((one) => one * devicePixelRatio));
    u.ctx.stroke(path);
    u.ctx.restore();
    return null;
  };
}
