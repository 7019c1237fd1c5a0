// Third step: what will be done, and what that is expected to do to this tissue.
import { get, type Schema } from "../../api";
import { duration } from "../../clock";
import { useLoaded, type Loaded } from "../../loaded";
import { Card, Rows, Show, shown, significant } from "../../parts/basics";
import { ModelChoice, keyOf, refOf, type ModelEntry } from "../../parts/models";
import { t } from "../../texts";

export type Protocol = Schema["ProtocolView"];
type Foresight = Schema["Foresight"];

const WORDS = { refused: "bad", "cut short": "warn", unknown: "warn", "as planned": "good" } as const;

function Fact({ name, value, unit }: { name: string; value: string; unit: string }) {
  return <div><dt>{name}</dt><dd>{value} <small>{unit}</small></dd></div>;
}

/** What is done at the depth asked for, and deeper; empty where a press is all. */
function beyond(settings: Protocol["settings"]): string {
  const [depth, second, swing] = ["depth_mm", "second_depth_mm", "dither_amplitude_mm"].map((name) => Number(settings[name] ?? 0)) as [number, number, number];
  const said = [swing > 0 && t.run.dither(significant(depth), significant(swing)), second > 0 && t.run.second(significant(depth), significant(second))];
  return said.filter(Boolean).join(" ");
}

function Contents({ protocol, seen }: { protocol: Protocol; seen: Foresight | null }) {
  const { settings } = protocol;
  const speeds = (settings.speeds_mm_s ?? []) as number[];
  const goesOn = beyond(settings);
  const asked_N = Number(settings.force_limit_N);
  return (
    <>
      <dl class="facts" id="contents">
        <Fact name={t.run.trials} value={t.run.trialsOf(speeds.length, Number(settings.trials))} unit="" />
        <Fact name={t.run.speeds} value={speeds.join(", ")} unit="mm/s" />
        <Fact name={goesOn ? t.run.deepest : t.run.depth} value={shown(seen?.depth_mm, 1)} unit="mm" />
        <Fact name={t.run.limit} value={shown(seen?.force_limit_N, 1)} unit="N" />
        <Fact name={t.run.hold} value={significant(Number(settings.hold_s))} unit="s" />
        <Fact name={t.run.lasts} value={seen ? duration(seen.duration_s) : t.unknown} unit="" />
      </dl>
      {seen && seen.force_limit_N < asked_N && <p id="lowered">{t.run.lowered(shown(asked_N, 1))}</p>}
      {goesOn && <p id="beyond">{goesOn}</p>}
    </>
  );
}

function Verdict({ seen }: { seen: Foresight }) {
  const last = seen.expected.at(-1);
  return (
    <div id="verdict" class={`notice ${WORDS[seen.verdict]}`}>
      <p><strong>{t.run.verdict[seen.verdict]}</strong></p>
      {last && (
        <dl class="facts large">
          <Fact name={t.run.expectedForce} value={significant(Math.max(...seen.expected.map((one) => one.force_N)), 2)} unit="N" />
          <Fact name={t.run.expectedDepth} value={significant(Math.min(...seen.expected.map((one) => one.depth_mm)), 2)} unit="mm" />
        </dl>
      )}
      <p>{seen.sentence}</p>
      {seen.doubt && <p>{seen.doubt}</p>}
    </div>
  );
}

function Table({ seen }: { seen: Foresight }) {
  if (!seen.expected.length) return null;
  return (
    <details>
      <summary>{t.run.bySpeed}</summary>
      <Rows label={t.run.bySpeed} heads={[t.run.speed, t.run.expectedForce, t.run.expectedDepth, t.run.endsBy]}>
        {seen.expected.map((one) => (
          <tr key={one.speed_mm_s}>
            <th scope="row">{one.speed_mm_s} mm/s</th><td>{significant(one.force_N)} N</td><td>{significant(one.depth_mm)} mm</td><td>{t.run.ends[one.ends]}</td>
          </tr>
        ))}
      </Rows>
    </details>
  );
}

interface Chosen {
  protocol: string;
  model: string;
  choose: (protocol: string) => void;
  chooseModel: (model: string) => void;
}

function Foreseen({ protocol, model, on }: { protocol: Protocol; model: ModelEntry | undefined; on: unknown }) {
  const asked = model && refOf(model);
  const seen = useLoaded(() => get("/api/v1/protocols/{name}/foresight", { path: { name: protocol.name }, query: { session: asked?.session, file: asked?.file } }), [protocol.name, model?.key, on]);
  // What was foreseen of another stands until this is known.
  const own = seen.value?.protocol === protocol.name ? seen.value : null;
  return (
    <>
      <Contents protocol={protocol} seen={own} />
      <Show loaded={seen}>{(found) => <><Verdict seen={found} /><Table seen={found} /></>}</Show>
    </>
  );
}

export function ProtocolStep({ protocols, models, chosen, on }: { protocols: Loaded<Protocol[]>; models: ModelEntry[]; chosen: Chosen; on: unknown }) {
  const model = models.find((one) => keyOf(refOf(one)) === chosen.model);
  return (
    <Card id="step-protocol" title={t.run.step(3, t.run.steps.protocol)}>
      <Show loaded={protocols} empty={<p>{t.run.none}</p>}>
        {(all) => {
          const one = all.find((each) => each.name === chosen.protocol);
          return (
            <>
              <div class="row choices">
                <label>{t.run.protocol}
                  <select id="protocol" required value={chosen.protocol} onChange={(event) => chosen.choose(event.currentTarget.value)}>
                    {all.map((each) => <option key={each.name} value={each.name}>{each.refusal ? `${each.name} (${t.run.refused})` : each.name}</option>)}
                  </select>
                </label>
                {models.length > 0 && <ModelChoice id="expected-model" label={t.run.tissue} models={models} chosen={chosen.model} choose={chosen.chooseModel} none={t.run.noModel} />}
              </div>
              {one && (one.refusal && !Object.keys(one.settings).length
                ? <p class="notice bad" id="verdict"><strong>{t.run.verdict.refused}</strong> {one.refusal}</p>
                : <Foreseen protocol={one} model={model} on={on} />)}
            </>
          );
        }}
      </Show>
    </Card>
  );
}
