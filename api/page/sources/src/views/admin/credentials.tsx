// Links that sign in once, accounts with a password, tokens for programs.
import { useState } from "preact/hooks";
import { every, post, remove, type Schema } from "../../api";
import { attempt } from "../../attempt";
import { date, duration } from "../../clock";
import { useLoaded } from "../../loaded";
import { Card, Prose, Rows, Show } from "../../parts/basics";
import { t } from "../../texts";

type Scope = Schema["TokenView"]["scope"];
const SCOPES: Scope[] = ["read", "operate", "admin"];

/** Something secret that is shown once: selected whole with a click, and copied where the browser lets us. */
function Once({ id, text, help }: { id: string; text: string; help: string }) {
  const copy = () => void attempt(async () => {
    await navigator.clipboard.writeText(text);
    return t.admin.copied;
  });
  return (
    <div class="notice warn" role="status">
      <p>{help}</p>
      <div class="row">
        <input id={id} class="grow secret" readOnly aria-label={help} value={text} onFocus={(event) => event.currentTarget.select()} />
        <button type="button" onClick={copy}>{t.admin.copy}</button>
      </div>
    </div>
  );
}

function Wanted({ id, label, button, make }: { id: string; label: string; button: string; make: (name: string, scope: Scope) => Promise<unknown> }) {
  const [name, setName] = useState("");
  const [scope, setScope] = useState<Scope>("operate");
  const send = (event: Event) => {
    event.preventDefault();
    void attempt(async () => {
      await make(name.trim(), scope);
      setName("");
    });
  };
  return (
    <form id={id} onSubmit={send}>
      <label>{label}<input id={`${id}-name`} required maxLength={80} autocomplete="off" value={name} onInput={(event) => setName(event.currentTarget.value)} /></label>
      <label>{t.admin.right}
        <select id={`${id}-scope`} value={scope} onChange={(event) => setScope(event.currentTarget.value as Scope)}>
          {SCOPES.map((one) => <option key={one} value={one}>{t.admin.scopes[one]}</option>)}
        </select>
      </label>
      <button type="submit">{button}</button>
    </form>
  );
}

export function Links() {
  const [made, show] = useState<{ address: string; lasts_s: number } | null>(null);
  const make = async (name: string, scope: Scope) => {
    const { ticket, lasts_s } = await post("/api/v1/auth/links", { body: { name, scope } });
    show({ address: `${location.origin}/#ticket=${ticket}`, lasts_s });
  };
  return (
    <Card title={t.admin.links}>
      <p>{t.admin.linksText}</p>
      <Wanted id="link" label={t.admin.forWhom} button={t.admin.makeLink} make={make} />
      {made && <Once id="link-made" text={made.address} help={t.admin.linkMade(duration(made.lasts_s))} />}
    </Card>
  );
}

export function Accounts() {
  const accounts = useLoaded(() => every("/api/v1/accounts"));
  return (
    <Card title={t.admin.accounts}>
      <p><Prose text={t.admin.accountsText} /></p>
      <Show loaded={accounts} empty={<p>{t.admin.noAccount}</p>}>
        {(all) => (
          <Rows label={t.table(t.admin.accounts)} heads={[t.admin.name, t.admin.right]} body="accounts">
            {all.map((one) => <tr key={one.name}><th scope="row">{one.name}</th><td>{t.admin.scopes[one.scope]}</td></tr>)}
          </Rows>
        )}
      </Show>
    </Card>
  );
}

function Revoke({ token, gone }: { token: Schema["TokenView"]; gone: () => void }) {
  const [sure, ask] = useState(false);
  const revoke = () => void attempt(async () => {
    await remove("/api/v1/tokens/{name}", { path: { name: token.id } });
    gone();
    return t.admin.revoked(token.name);
  });
  if (!sure) return <button type="button" class="small" aria-label={t.admin.revokeName(token.name)} onClick={() => ask(true)}>{t.admin.revoke}</button>;
  return (
    <span class="row">
      <button type="button" class="small danger" onClick={revoke}>{t.admin.revokeNow(token.name)}</button>
      <button type="button" class="small" onClick={() => ask(false)}>{t.admin.keep}</button>
    </span>
  );
}

export function Tokens() {
  const tokens = useLoaded(() => every("/api/v1/tokens"));
  const [made, show] = useState("");
  const make = async (name: string, scope: Scope) => {
    show((await post("/api/v1/tokens", { body: { name, scope } })).token);
    tokens.reload();
  };
  return (
    <Card title={t.admin.tokens}>
      <p>{t.admin.tokensText}</p>
      <Wanted id="token" label={t.admin.whatFor} button={t.admin.makeToken} make={make} />
      {made && <Once id="token-made" text={made} help={t.admin.tokenMade} />}
      <Show loaded={tokens} empty={<p>{t.admin.noToken}</p>}>
        {(all) => (
          <Rows label={t.table(t.admin.tokens)} heads={[t.admin.name, t.admin.right, t.admin.madeAt, ""]} body="tokens">
            {all.map((one) => (
              <tr key={one.id}>
                <th scope="row">{one.name}</th><td>{t.admin.scopes[one.scope]}</td><td>{date(one.created)}</td>
                <td class="number"><Revoke token={one} gone={tokens.reload} /></td>
              </tr>
            ))}
          </Rows>
        )}
      </Show>
    </Card>
  );
}
