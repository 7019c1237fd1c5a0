// Who was measured, what came of it over time, and a person's data as a whole: taken along or erased.
import { useState } from "preact/hooks";
import { every, type Schema } from "../api";
import { date } from "../clock";
import { useLoaded } from "../loaded";
import { Card, Rows, Show } from "../parts/basics";
import { link } from "../route";
import { may } from "../session";
import { t } from "../texts";
import { History } from "./subjects/history";

type Subject = Schema["SubjectEntry"];

const fits = (subject: Subject, asked: string, site: string) =>
  (!site || subject.sites.includes(site)) && [subject.subject, subject.name ?? ""].some((text) => text.toLowerCase().includes(asked.trim().toLowerCase()));

function Table({ subjects }: { subjects: readonly Subject[] }) {
  const heads = [t.subjects.code, t.subjects.name, t.subjects.sites, t.subjects.sessions, t.subjects.last];
  return (
    <Rows label={t.table(t.subjects.title)} heads={heads} body="subjects">
      {subjects.map((one) => (
        <tr key={one.subject}>
          <th scope="row"><a href={link("subjects", one.subject)}>{one.subject}</a></th>
          <td>{one.name ?? <span class="quiet">{may("operate") ? t.subjects.nameless : t.subjects.hidden}</span>}</td>
          <td>{one.sites.join(", ")}</td>
          <td>{one.sessions}</td>
          <td>{one.last && date(one.last)}</td>
        </tr>
      ))}
    </Rows>
  );
}

function List() {
  const found = useLoaded(() => every("/api/v1/subjects"));
  const [asked, ask] = useState("");
  const [site, choose] = useState("");
  const sites = [...new Set((found.value ?? []).flatMap((one) => one.sites))].sort();
  const shown = (found.value ?? []).filter((one) => fits(one, asked, site));
  return (
    <>
      <h1>{t.subjects.title}</h1>
      <Card title={t.subjects.list}>
        <Show loaded={found} empty={<p>{t.subjects.none}</p>}>
          {() => (
            <>
              <form role="search" class="tools" onSubmit={(event) => event.preventDefault()}>
                <label>{t.subjects.search}
                  <input id="subject-search" type="search" value={asked} onInput={(event) => ask(event.currentTarget.value)} />
                </label>
                <label>{t.subjects.site}
                  <select id="subject-site" value={site} onChange={(event) => choose(event.currentTarget.value)}>
                    <option value="">{t.subjects.everySite}</option>
                    {sites.map((one) => <option key={one} value={one}>{one}</option>)}
                  </select>
                </label>
              </form>
              <p class="quiet" role="status">{t.subjects.found(shown.length)}</p>
              {shown.length > 0 && <Table subjects={shown} />}
            </>
          )}
        </Show>
      </Card>
    </>
  );
}

export function Subjects({ of }: { of: string }) {
  return of ? <History code={of} /> : <List />;
}
