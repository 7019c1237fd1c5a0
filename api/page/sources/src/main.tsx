import { render } from "preact";
import "uplot/dist/uPlot.min.css";
import "./style.css";
import { keepLease } from "./lease";
import { listen } from "./live";
import { Shell } from "./parts/shell";
import { followAddress, place } from "./route";
import { me, signIn } from "./session";
import { listenForEscape } from "./stop";
import { t } from "./texts";
import { SHOWN } from "./views";
import { Login } from "./views/login";

function App() {
  if (!me.value) return <Shell bare><Login /></Shell>;
  const { view, of } = place.value;
  const View = SHOWN[view];
  // Another session is another view: nothing of the one before stays in a field.
  return <Shell><View key={`${view}/${of}`} of={of} /></Shell>;
}

document.documentElement.lang = t.lang;
// The stop first: it works while the rest still loads, and if the rest fails.
listenForEscape();
void signIn(() => {
  followAddress();
  keepLease();
  listen();
});
render(<App />, document.getElementById("app")!);
