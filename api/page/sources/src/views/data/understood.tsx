// What the files seem to hold: each column in words, what is doubtful, what only a person can say.
import { useState } from "preact/hooks";
import type { Schema } from "../../api";
import { attempt } from "../../attempt";
import { sessionName } from "../../clock";
import { start } from "../../jobs";
import { Card, Rows } from "../../parts/basics";
import { Start, whyNotWork } from "../../parts/may";
import { t } from "../../texts";

type Found = Schema["ProposalResult"];

function Columns({ found }: { found: Found }) {
  if (!found.columns.length) return <div class="empty"><p>{t.data.nothing}</p></div>;
  return (
    <Rows label={t.table(t.data.understood)} heads={t.data.columns} body="columns">
      {found.columns.map((one) => (
        <tr key={`${one.files} ${one.quantity}`}>
          <th scope="row">{t.data.quantities[one.quantity] ?? one.quantity}</th>
          <td>{one.column || <span class="no">{t.data.asked}</span>}</td><td>{one.unit}</td><td>{one.positive}</td><td>{one.files}</td>
        </tr>
      ))}
    </Rows>
  );
}

function Questions({ found, answers, answer }: { found: Found; answers: string[]; answer: (all: string[]) => void }) {
  if (!found.questions.length) return null;
  const say = (i: number, text: string) => answer(answers.map((before, j) => (i === j ? text : before)));
  return (
    <fieldset id="questions" class="questions">
      <legend>{t.data.questions}</legend>
      {found.questions.map((question, i) => (
        <label key={question.line} class="full">{question.text}
          <input id={`answer-${i}`} required autocomplete="off" value={answers[i]} placeholder={question.usual} onInput={(event) => say(i, event.currentTarget.value)} />
        </label>
      ))}
    </fieldset>
  );
}

export function Understood({ upload, found, begin, done }: { upload: string; found: Found; begin: (job: string) => void; done: boolean }) {
  const [session, name] = useState(sessionName());
  const [mapping, map] = useState(found.mapping);
  const [answers, answer] = useState(found.questions.map((question) => question.usual ?? ""));
  const edited = mapping !== found.mapping;
  const bring = (event: Event) => {
    event.preventDefault();
    // A mapping that was written by hand answers for itself.
    const said = edited ? { mapping } : { answers: answers.map((one) => one.trim()) };
    void attempt(async () => begin((await start("import", { upload, session, ...said })).id));
  };
  return (
    <Card title={t.data.understood}>
      <Columns found={found} />
      {found.doubts.length > 0 && <div id="doubts" class="notice warn" role="status"><p>{t.data.doubts}</p><ul>{found.doubts.map((one) => <li key={one}>{one}</li>)}</ul></div>}
      <form id="import" onSubmit={bring}>
        {!edited && <Questions found={found} answers={answers} answer={answer} />}
        <details class="full">
          <summary>{t.data.mapping}</summary>
          <p class="quiet">{t.data.mappingHelp}</p>
          <textarea id="mapping" aria-label={t.data.mapping} rows={14} spellcheck={false} value={mapping} onInput={(event) => map(event.currentTarget.value)} />
          {edited && <button type="button" class="small" onClick={() => map(found.mapping)}>{t.data.proposed}</button>}
        </details>
        <label>{t.run.session}
          <input id="import-session" required pattern="[A-Za-z0-9][A-Za-z0-9_.\-]{0,63}" autocomplete="off" value={session} onInput={(event) => name(event.currentTarget.value)} />
        </label>
        <Start id="bring" why={whyNotWork() || (done ? t.data.isIn : "")}>{t.data.import}</Start>
      </form>
    </Card>
  );
}
