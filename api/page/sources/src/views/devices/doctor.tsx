// Each device by itself: who it says it is, its rate, noise and latency, and what is wrong with it.
import { useState } from "preact/hooks";
import type { Schema } from "../../api";
import { attempt } from "../../attempt";
import { start, useJob } from "../../jobs";
import { Card, Dot, Rows, shown, significant } from "../../parts/basics";
import { JobState } from "../../parts/job";
import { Start, whyNotWork } from "../../parts/may";
import { t } from "../../texts";

type Result = Schema["DoctorResult"];

function Found({ devices }: Result) {
  const bad = devices.filter((one) => one.problem).length;
  return (
    <>
      <p id="doctor-verdict" role="status" class={bad ? "notice bad" : "notice"}>{bad ? t.devices.problems(bad) : t.devices.allWell(devices.length)}</p>
      <Rows label={t.table(t.devices.doctor)} heads={t.devices.doctorColumns} body="doctor-devices">
        {devices.map((one) => (
          <tr key={one.role}>
            <th scope="row">{t.devices.roles[one.role] ?? one.role}</th>
            <td>{one.product || t.unknown}{one.serial && <p class="quiet">{t.devices.serial} {one.serial}</p>}</td>
            <td>{one.problem ? <><Dot kind="bad" /><span class="no">{one.problem}</span>{one.advice && <p>{t.devices.lookAt(one.advice)}</p>}</> : <><Dot kind="good" /><span class="yes">{t.bench.healthWord.ok}</span></>}</td>
            <td>{one.rate_Hz ? `${shown(one.rate_Hz, 0)} Hz` : t.unknown}</td>
            <td>{one.noise || t.unknown}</td>
            <td>{one.latency_ms ? `${significant(one.latency_ms)} ms` : t.unknown}</td>
            <td>{one.range || t.unknown}</td>
          </tr>
        ))}
      </Rows>
    </>
  );
}

export function Doctor() {
  const [asked, ask] = useState("");
  const job = useJob<Result>(asked);
  const look = () => void attempt(async () => ask((await start("doctor", {})).id));
  return (
    <Card title={t.devices.doctor}>
      <p>{t.devices.doctorText}</p>
      <Start id="doctor" why={whyNotWork()} onClick={look}>{t.devices.doctor}</Start>
      <JobState job={job} />
      {job?.result && <Found {...job.result} />}
    </Card>
  );
}
