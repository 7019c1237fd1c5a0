// One subject: sessions, how stiff each found the tissue, thresholds, diagnoses.
import { useState } from "preact/hooks";
import { marked, put, type Answer, type Schema } from "../../api";
import { attempt } from "../../attempt";
import { date } from "../../clock";
import { useLoaded } from "../../loaded";
import { Card, Rows, Show, shown, significant } from "../../parts/basics";
import { XYPlot, type Curve } from "../../plot";
import { link } from "../../route";
import { may } from "../../session";
import { t } from "../../texts";
import { Whole } from "./whole";

const PATH = "/api/v1/subjects/{subject}";
type Known = Answer<typeof PATH, "get">;
type Stiffness = Schema["StiffnessEntry"];

const COLOURS = ["--force", "--depth", "--error", "--setpoint"];
const DAY_MS = 86_400_000;

function Name({ code, now, mark, again }: { code: string; now: string; mark: string; again: () => void }) {
  const [name, give] = useState(now);
  const keep = (event: Event) => {
    event.preventDefault();
    void attempt(async () => {
      await put("/api/v1/subjects/{subject}/name", { path: { subject: code }, body: { name: name.trim() }, headers: { "If-Match": mark } });
      return name.trim() ? t.subjects.named : t.subjects.forgotten;
    }).then(again);
  };
  return (
    <form onSubmit={keep}>
      <label>{t.subjects.name}
        <input id="subject-name" autocomplete="off" maxLength={200} value={name} onInput={(event) => give(event.currentTarget.value)} />
      </label>
      <button id="keep-name" type="submit" disabled={name.trim() === now}>{t.subjects.keepName}</button>
    </form>
  );
}

/** Points joined by a line for each site, over days, above a line at zero: a small change must not look like a large one. */
function curves(found: readonly Stiffness[]): Curve[] {
  const first_ms = Math.min(...found.map((one) => Date.parse(one.at)));
  const days = (one: Stiffness) => (Date.parse(one.at) - first_ms) / DAY_MS;
  // One session alone spans nothing: a day around it reads as days do.
  const most = Math.max(...found.map(days));
  const span = most ? Math.max(1 / 24, most) : 1;
  const sites = [...new Set(found.map((one) => one.site))].sort();
  const zero = { x: [-0.05 * span, 1.05 * span], y: [0, 0], label: "0", colour: "--line" };
  const lines = sites.flatMap((site, i) => {
    const own = found.filter((one) => one.site === site).reverse();
    const line = { x: own.map(days), y: own.map((one) => one.stiffness_N_mm), label: site, colour: COLOURS[i % COLOURS.length]! };
    return [line, { ...line, points: true }];
  });
  return [zero, ...lines];
}

function Stiffnesses({ found }: { found: readonly Stiffness[] }) {
  if (!found.length) return <div class="empty"><p>{t.subjects.noModel}</p></div>;
  const sites = [...new Map(found.map((one) => [one.site, one.depth_mm]))].sort();
  return (
    <figure class="plot" id="stiffness">
      <figcaption>
        {sites.map(([site, depth_mm], i) => (
          <span class="key" key={site}><i class="swatch" style={{ color: `var(${COLOURS[i % COLOURS.length]})` }} /> {t.subjects.ofSite(site, significant(depth_mm, 2))}</span>
        ))}
      </figcaption>
      <XYPlot id="stiffness-plot" label={t.subjects.stiffnessPlot(found.length)} xUnit={t.subjects.days} unit="N/mm" height={200} curves={() => curves(found)} on={[found]} />
    </figure>
  );
}

function Row({ session, known }: { session: Schema["SessionEntry"]; known: Known }) {
  const of = <T extends { session: string }>(all: readonly T[]) => all.find((one) => one.session === session.session);
  const stiffness = of(known.stiffness ?? []);
  const diagnosis = of(known.diagnoses);
  const threshold = of(known.thresholds);
  return (
    <tr>
      <th scope="row"><a href={link("session", session.session)}>{session.session}</a></th>
      <td>{date(session.at)}<p class="quiet">{[t.subjects.kinds[session.kind] ?? session.kind, session.site].filter(Boolean).join(", ")}</p></td>
      <td>{t.quality[session.quality || "none"] ?? session.quality}{session.remarks.map((remark) => <p class="quiet" key={remark}>{remark}</p>)}</td>
      <td>{stiffness ? `${significant(stiffness.stiffness_N_mm)} N/mm` : t.unknown}</td>
      <td>{threshold ? (threshold.force_N === null ? t.subjects.above(threshold.up_to_N) : `${shown(threshold.force_N, 1)} N`) : t.unknown}</td>
      <td>{diagnosis ? diagnosis.statement : t.unknown}</td>
    </tr>
  );
}

function Sessions({ known }: { known: Known }) {
  if (!known.sessions.length) return <div class="empty"><p>{t.subjects.noSession}</p></div>;
  return (
    <Rows label={t.table(t.subjects.sessions)} heads={t.subjects.columns} body="subject-sessions">
      {known.sessions.map((session) => <Row key={session.key} session={session} known={known} />)}
    </Rows>
  );
}

function Facts({ known }: { known: Known }) {
  const { sessions, first, last, sites } = known.subject;
  const facts: [string, string | number][] = [
    [t.subjects.sessions, sessions], [t.subjects.sites, sites.join(", ") || t.unknown],
    [t.subjects.first, first ? date(first) : t.unknown], [t.subjects.last, last ? date(last) : t.unknown],
  ];
  return <dl class="facts">{facts.map(([name, value]) => <div key={name}><dt>{name}</dt><dd>{value}</dd></div>)}</dl>;
}

export function History({ code }: { code: string }) {
  const found = useLoaded(() => marked<Known>(PATH, { path: { subject: code } }), [code]);
  const name = found.value?.value.subject.name;
  return (
    <>
      <p><a href={link("subjects")}>{t.subjects.back}</a></p>
      <h1>{name ? t.subjects.both(name, code) : t.subjects.one(code)}</h1>
      <Show loaded={found}>
        {({ value: known, mark }) => (
          <>
            <Card title={t.subjects.about}>
              <Facts known={known} />
              {may("operate") ? <Name code={code} now={known.subject.name ?? ""} mark={mark} again={found.reload} /> : <p class="quiet">{t.subjects.namesHidden}</p>}
            </Card>
            <Card title={t.subjects.stiffness} aside={<span class="quiet">{t.subjects.stiffnessHelp}</span>}><Stiffnesses found={known.stiffness ?? []} /></Card>
            <Card title={t.subjects.sessions}><Sessions known={known} /></Card>
            <Whole code={code} />
          </>
        )}
      </Show>
    </>
  );
}
