// Bring your own data: files, what they seem to hold, what only a person can say, and what came in.
import { useState } from "preact/hooks";
import type { Schema } from "../api";
import { useJob } from "../jobs";
import { Card } from "../parts/basics";
import { JobState } from "../parts/job";
import { t } from "../texts";
import { CameIn } from "./data/came_in";
import { Files } from "./data/files";
import { Understood } from "./data/understood";

export function Data() {
  const [upload, uploaded] = useState("");
  const [reading, read] = useState("");
  const [importing, bring] = useState("");
  const proposed = useJob<Schema["ProposalResult"]>(reading);
  const imported = useJob<Schema["ImportResult"]>(importing);
  const begin = (identifier: string, job: string) => {
    uploaded(identifier);
    read(job);
    bring("");
  };
  return (
    <>
      <h1>{t.data.title}</h1>
      <Card title={t.data.files}>
        <p>{t.data.text}</p>
        <Files begin={begin} />
        <JobState job={proposed} />
      </Card>
      {proposed?.result && <Understood key={reading} upload={upload} found={proposed.result} begin={bring} done={imported?.state === "succeeded"} />}
      <JobState job={imported} />
      {imported?.result && <CameIn session={imported.session ?? imported.result.session} found={imported.result} />}
    </>
  );
}
