// Who the devices are, how they are, what they were calibrated by, and the way back after something went wrong.
import { Card, Dot, Rows, shown } from "../parts/basics";
import { startRecovery } from "../parts/attention";
import { fresh, rig } from "../live";
import { may } from "../session";
import { t } from "../texts";
import { CalibrateAxis, CalibrateDynamics, CalibrateForce, CalibrateGlove } from "./devices/calibrate";
import { Calibrations } from "./devices/calibrations";
import { Doctor } from "./devices/doctor";

// A stream of samples and the device it comes from.
const STREAMS = { force: "force", axis: "axis", marker: "tracker" } as const;
const HEADS = [t.devices.stream, t.devices.product, t.devices.state, t.devices.alive, t.devices.valid, t.devices.onRate, t.devices.rate];

function Row({ stream, role }: { stream: string; role: string }) {
  const now = rig.value!;
  const device = now.devices[role]!;
  const health = now.health[stream] ?? {};
  const good = device.state === "ok";
  // Of a device that is gone only what was is known.
  const there = good || device.state === "degraded" || device.state === "fault";
  const word = (yes: boolean | undefined) => !there ? <td>{t.unknown}</td> : <td class={yes ? "yes" : "no"}>{yes ? t.devices.yes : t.devices.no}</td>;
  const who = [device.serial && `${t.devices.serial} ${device.serial}`, device.firmware && `${t.devices.firmware} ${device.firmware}`].filter(Boolean);
  return (
    <tr>
      <th scope="row">{t.devices.roles[role] ?? role}</th>
      <td>{device.product}{who.length > 0 && <p class="quiet">{who.join(", ")}</p>}</td>
      <td class={good ? "yes" : "no"}><Dot kind={good ? "good" : "bad"} />{t.bench.healthWord[device.state ?? ""] ?? t.unknown}{!good && device.detail && <p class="quiet">{device.detail}</p>}</td>
      {word(health.alive)}{word(health.valid)}{word(health.on_rate)}
      <td class="number">{shown(now.rates_Hz?.[stream], 0)}</td>
    </tr>
  );
}

function Streams() {
  const devices = rig.value?.devices ?? {};
  // An input's stream has its own name; its health is its state.
  const inputs = Object.keys(devices).filter((name) => !Object.values<string>(STREAMS).includes(name)).map((name) => [name, name] as const);
  const rows = [...Object.entries(STREAMS).filter(([, role]) => devices[role]), ...inputs];
  if (!rows.length) return <div class="empty"><p>{t.bench.noDevices}</p></div>;
  return (
    <div class={fresh.value ? "" : "stale"}>
      <Rows label={t.table(t.devices.each)} heads={HEADS} body="devices">{rows.map(([stream, role]) => <Row key={stream} stream={stream} role={role} />)}</Rows>
    </div>
  );
}

const UNITS: Record<string, string> = { force_N: "N", depth_mm: "mm", speed_mm_s: "mm/s" };

function Limits() {
  return (
    <Card title={t.devices.limits}>
      <p>{t.devices.limitsText}</p>
      <dl class="facts">
        {Object.entries(rig.value?.limits ?? {}).map(([name, value]) => <div key={name}><dt>{t.devices.limit[name] ?? name}</dt><dd>{value} {UNITS[name]}</dd></div>)}
      </dl>
    </Card>
  );
}

export function Devices() {
  return (
    <>
      <h1>{t.devices.title}</h1>
      <Card title={t.devices.each}><Streams /></Card>
      <Doctor />
      <Calibrations />
      <div class="grid">
        <CalibrateForce />
        <CalibrateGlove />
      </div>
      <div class="grid">
        <CalibrateAxis />
        <CalibrateDynamics />
      </div>
      <div class="grid">
        <Card title={t.devices.recovery}>
          <p>{t.devices.recoveryText}</p>
          <button id="start-recovery" type="button" disabled={!may("operate")} onClick={startRecovery}>{t.attention.recover}</button>
          {!may("operate") && <p class="quiet">{t.may.look}</p>}
        </Card>
        <Limits />
      </div>
    </>
  );
}
