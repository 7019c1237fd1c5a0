// `rig.v1`: samples in batches with their least and greatest, events, and what was missed after a break.
export interface Batch {
  stream: string;
  columns: string[];
  times_s: Float64Array;
  values: Float32Array[];
}

export interface RigEvent {
  seq: number;
  time_ns: number;
  source: string;
  level: number;
  code: string;
  text: string;
}

interface Channel {
  channel: number;
  stream: string;
  columns: string[];
  step: number;
}

export interface Asked {
  streams: string[];
  max_rate_hz: number;
  decimate: "minmax" | "last";
}

export interface Heard {
  message: () => void;
  /** The connection has ended; another is tried. */
  closed: () => void;
  /** The clock of the bench [s] as it greets. */
  open: (now_s: number) => void;
  run: () => void;
  batch: (batch: Batch) => void;
  event: (event: RigEvent) => void;
  gap: (stream: string, dropped: number) => void;
}

const HEADER_BYTES = 24;
// A service that restarts is back within seconds; more tries than two a second help nobody.
const AGAIN_MS = 500;
// A service says something every 0.2 s. Where another network or a sleeping computer cut the line, nobody closes it:
// what has been silent for this long is given up. A browser holds an attempt back by 5 s after others that failed.
const DEAD_MS = 10_000;

export class Stream {
  private socket: WebSocket | null = null;
  private channels = new Map<number, Channel>();
  private seq: Record<string, number> = {};
  private run = "";
  private session = "";
  private event: number | null = null;
  private patience = 0;

  constructor(
    private readonly asked: Asked[],
    private readonly heard: Heard,
  ) {}

  open(): void {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/api/v1/stream`, "rig.v1");
    this.socket = socket;
    this.wait();
    socket.binaryType = "arraybuffer";
    socket.onmessage = (message) => {
      if (socket !== this.socket) return;
      this.wait();
      this.heard.message();
      if (typeof message.data === "string") this.told(JSON.parse(message.data));
      else this.sampled(message.data as ArrayBuffer);
    };
    socket.onclose = () => {
      if (socket !== this.socket) return;
      this.heard.closed();
      this.again();
    };
  }

  private wait(): void {
    clearTimeout(this.patience);
    this.patience = window.setTimeout(() => this.again(), DEAD_MS);
  }

  private again(): void {
    clearTimeout(this.patience);
    const before = this.socket;
    this.socket = null;
    before?.close();
    setTimeout(() => this.open(), AGAIN_MS);
  }

  private told(said: Record<string, unknown>): void {
    if (said.type === "hello") this.greet(said as never);
    else if (said.type === "subscribed") for (const one of (said as unknown as { channels: Channel[] }).channels) this.channels.set(one.channel, one);
    else if (said.type === "run") this.begin((said as unknown as { run: string }).run);
    else if (said.type === "gap") this.heard.gap(said.stream as string, said.dropped as number);
    // Each subscription is told what came meanwhile.
    else if (said.type === "event" && (said.seq as number) > (this.event ?? 0)) {
      this.event = said.seq as number;
      this.heard.event(said as unknown as RigEvent);
    }
  }

  private begin(run: string): void {
    this.seq = {};
    this.run = run;
    this.heard.run();
  }

  private greet(hello: { session_id: string; run: string; monotonic_ns: number; event_seq: number; streams: { name: string }[] }): void {
    if (hello.run !== this.run) this.begin(hello.run);
    // A service that was begun anew tells all of its own; what was before this page was opened is not asked for.
    if (hello.session_id !== this.session) this.event = this.session ? 0 : hello.event_seq;
    this.session = hello.session_id;
    this.channels.clear();
    const anew = !Object.keys(this.seq).length;
    const known = new Set(hello.streams.map((one) => one.name));
    for (const { streams, ...how } of this.asked) {
      const wanted = streams.filter((name) => known.has(name));
      const since_seq = Object.fromEntries(wanted.filter((name) => anew || name in this.seq).map((name) => [name, this.seq[name] ?? 0]));
      // A number counted in no run asks for all that is kept.
      const run = anew ? "" : this.run;
      this.socket!.send(JSON.stringify({ type: "subscribe", streams: wanted, ...how, run, since_seq, session_id: this.session, since_event: this.event }));
    }
    this.heard.open(hello.monotonic_ns * 1e-9);
  }

  /** Batches follow each other in one message. */
  private sampled(data: ArrayBuffer): void {
    const view = new DataView(data);
    for (let at = 0; at + HEADER_BYTES <= data.byteLength; ) {
      const [channel, columns] = [view.getUint16(at, true), view.getUint16(at + 2, true)];
      const seq = view.getUint32(at + 4, true);
      const t0_s = Number(view.getBigInt64(at + 8, true)) * 1e-9;
      const [n, covered] = [view.getUint32(at + 16, true), view.getUint32(at + 20, true)];
      const body = at + HEADER_BYTES;
      const offsets = new Int32Array(data.slice(body, body + 4 * n));
      const values = Array.from({ length: columns }, (_, i) => new Float32Array(data.slice(body + 4 * n * (i + 1), body + 4 * n * (i + 2))));
      at = body + 4 * n * (columns + 1);
      const of = this.channels.get(channel);
      if (!of) continue;
      this.seq[of.stream] = seq + (covered - 1) * of.step;
      this.heard.batch({ stream: of.stream, columns: of.columns, times_s: Float64Array.from(offsets, (offset) => t0_s + offset * 1e-9), values });
    }
  }
}
