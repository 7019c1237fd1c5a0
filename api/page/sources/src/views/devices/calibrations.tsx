// What force sensor and axis were calibrated by, and whether that may still be used.
import { every, type Schema } from "../../api";
import { date } from "../../clock";
import { useLoaded } from "../../loaded";
import { Card, Dot, Prose, Rows, Show, significant } from "../../parts/basics";
import { t } from "../../texts";

type Calibration = Schema["CalibrationView"];

function Row({ one }: { one: Calibration }) {
  return (
    <tr>
      <th scope="row">{t.devices.roles[one.what]}{one.used && <span class="quiet"> {t.devices.used}</span>}</th>
      <td>{[one.product, one.serial].filter(Boolean).join(" ") || t.unknown}<p class="quiet">{one.file || t.devices.ownFile}</p></td>
      <td>{one.date ? date(one.date) : t.unknown}</td>
      <td>{one.uncertainty_percent == null ? t.unknown : `${significant(one.uncertainty_percent, 2)} %`}</td>
      <td>{one.refused ? <><Dot kind="bad" /><span class="no">{one.refused}</span></> : <><Dot kind="good" />{t.devices.fit}</>}</td>
    </tr>
  );
}

export function Calibrations() {
  const found = useLoaded(() => every("/api/v1/calibrations"));
  return (
    <Card title={t.devices.calibrations}>
      <Show loaded={found} empty={<p>{t.devices.noCalibration}</p>}>
        {(all) => (
          <Rows label={t.table(t.devices.calibrations)} heads={t.devices.calibrationColumns} body="calibrations">
            {all.map((one) => <Row key={`${one.what} ${one.used} ${one.file}`} one={one} />)}
          </Rows>
        )}
      </Show>
      <p><Prose text={t.devices.calibrateText} /></p>
    </Card>
  );
}
