// What is shown to those who may not look: how to get in. The stop above works for everybody on this computer.
import { useState } from "preact/hooks";
import { Card, Prose } from "../parts/basics";
import { entering, logIn, refusal } from "../session";
import { t } from "../texts";

function Password() {
  const [name, setName] = useState("");
  const [password, setPassword] = useState("");
  const [waiting, wait] = useState(false);
  const enter = async (event: Event) => {
    event.preventDefault();
    wait(true);
    try {
      await logIn(name.trim(), password);
    } catch (error) {
      refusal.value = (error as Error).message;
      setPassword("");
      wait(false);
    }
  };
  return (
    <form id="login-form" class="column" onSubmit={enter}>
      <label>{t.login.name}
        <input id="login-name" name="username" required maxLength={80} autocomplete="username" value={name} onInput={(event) => setName(event.currentTarget.value)} />
      </label>
      <label>{t.login.password}
        <input id="login-password" name="password" type="password" required maxLength={200} autocomplete="current-password" value={password} onInput={(event) => setPassword(event.currentTarget.value)} />
      </label>
      <button id="login-enter" type="submit" class="primary" disabled={waiting}>{waiting ? t.login.checking : t.login.enter}</button>
    </form>
  );
}

// Where nothing is said of the port, the command asks there itself.
const USUAL_PORT = "8000";
const COMMAND = t.login.command(location.port === USUAL_PORT ? "" : location.port);

export function Login() {
  if (entering.value) return <p class="quiet loading" role="status">{t.loading}</p>;
  return (
    <>
      <h1>{t.login.title}</h1>
      <p>{t.login.text}</p>
      {refusal.value && <p id="refusal" class="notice bad" role="alert"><Prose text={refusal.value.replace("`rig token link`", COMMAND)} /></p>}
      <div class="grid">
        <Card title={t.login.byPassword} id="login"><Password /></Card>
        <Card title={t.login.byLink}>
          <ol>{t.login.ways(COMMAND).map((way) => <li key={way}><Prose text={way} /></li>)}</ol>
          <button type="button" onClick={() => location.reload()}>{t.login.again}</button>
        </Card>
      </div>
    </>
  );
}
