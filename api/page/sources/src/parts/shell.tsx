// The frame of every view: who we are, how the bench is, the stop, where to go.
import type { ComponentChildren } from "preact";
import { attempt } from "../attempt";
import { contact, pressing, rig } from "../live";
import { link, place } from "../route";
import { entering, me, signOut } from "../session";
import { alone, pressStop, stop } from "../stop";
import { t } from "../texts";
import { LISTED, UNDER } from "../views";
import { Attention } from "./attention";
import { Dot } from "./basics";
import { Control } from "./control";

function stateWord(): string {
  if (!me.value) return entering.value ? t.state.connecting : t.state.refused;
  if (contact.value !== "live") return t.state[contact.value];
  if (rig.value?.state === "idle" && pressing.value !== null) return (rig.value.depth_mm ?? 0) < 0 ? t.state.touched : t.state.pressing;
  return rig.value ? t.state[rig.value.state as keyof typeof t.state] : t.state.connecting;
}

function stateKind(): "good" | "warn" | "bad" | "none" {
  if (!me.value) return "none";
  if (contact.value === "silent") return "bad";
  if (contact.value !== "live") return "none";
  if (rig.value?.state === "idle" && pressing.value !== null) return "warn";
  return ({ idle: "good", running: "good", "not ready": "warn", stopped: "bad", disconnected: "bad" } as const)[rig.value?.state ?? "disconnected"] ?? "none";
}

function Navigation() {
  const here = UNDER[place.value.view] ?? place.value.view;
  return (
    <nav aria-label={t.navigation}>
      {LISTED.map((view) => <a key={view} href={link(view)} aria-current={here === view ? "page" : undefined}>{t.views[view]}</a>)}
    </nav>
  );
}

export function Shell({ children, bare = false }: { children: ComponentChildren; bare?: boolean }) {
  return (
    <div class={`shell ${contact.value}`}>
      <a class="skip" href="#view" onClick={(event) => { event.preventDefault(); document.getElementById("view")?.focus(); }}>{t.skip}</a>
      <div class="top">
        <header class="bar">
          <p class="brand">{t.title}</p>
          <p class="state" role="status" aria-live="polite"><Dot kind={stateKind()} /><span id="state">{stateWord()}</span></p>
          {!bare && <Control />}
          <button id="estop" class="estop" type="button" aria-keyshortcuts="Escape" title={t.stop.hint} onClick={() => void pressStop("estop")}>{t.stop.button}</button>
        </header>
        {stop.value && <p id="stop-banner" class={stop.value.state} role="alert">{stop.value.text}{contact.value === "silent" && stop.value.state === "confirmed" && ` ${t.stop.since(stop.value.at)}`}</p>}
        {!bare && <Navigation />}
      </div>
      <main id="view" tabIndex={-1}>
        {!bare && <Attention />}
        {children}
      </main>
      <footer class="quiet">
        <p>{t.stop.note}{alone.value && <span id="stop-alone"> {t.stop.alone}</span>}</p>
        {!bare && me.value && <p>{t.login.who(me.value.name || t.login.nameless)} <button id="logout" class="small" type="button" onClick={() => void attempt(signOut)}>{t.login.logout}</button></p>}
      </footer>
    </div>
  );
}
