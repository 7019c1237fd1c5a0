// Who may use the bench, by what, and what everybody did.
import { Card } from "../parts/basics";
import { may } from "../session";
import { t } from "../texts";
import { Audit } from "./admin/audit";
import { Accounts, Links, Tokens } from "./admin/credentials";

export function Admin() {
  return (
    <>
      <h1>{t.admin.title}</h1>
      {may("admin") ? (
        <>
          <div class="grid">
            <Links />
            <Accounts />
          </div>
          <Tokens />
          <Audit />
        </>
      ) : (
        <Card title={t.admin.closed} id="closed"><p>{t.admin.closedText}</p></Card>
      )}
    </>
  );
}
