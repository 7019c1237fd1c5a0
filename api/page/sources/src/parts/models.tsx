// Fitted models to choose from, and where one comes from.
import { every, type Schema } from "../api";
import { date } from "../clock";
import { useLoaded, type Loaded } from "../loaded";
import { t } from "../texts";
import { significant } from "./basics";

export type ModelEntry = Schema["ModelEntry"];

/** What work that needs a model is told. */
export interface ModelRef {
  session: string;
  file: "fit" | "diagnosis";
}

export const refOf = (model: ModelEntry): ModelRef => ({ session: model.session, file: model.file.startsWith("diagnosis") ? "diagnosis" : "fit" });
export const keyOf = (model: ModelRef) => `${model.file}/${model.session}`;

/** The first of ``models`` that is of ``subject``: what is fitted to somebody else is taken only where a person says so. */
export const ownModel = (models: readonly ModelEntry[], subject: string) => models.find((one) => subject && one.subject === subject);

const adds = (model: ModelEntry) => refOf(model).file === "fit" || model.causes.length > 0;

/** All models, those of ``subject`` first; a fit before a diagnosis that named no cause and so says no more. */
export function useModels(subject: string): Loaded<ModelEntry[]> {
  return useLoaded(async () => {
    const items = (await every("/api/v1/models")).sort((one, other) => Number(adds(other)) - Number(adds(one)));
    return [...items.filter((one) => one.subject === subject), ...items.filter((one) => one.subject !== subject)];
  }, [subject]);
}

export function ModelChoice({ id, label, models, chosen, choose, none }: { id: string; label: string; models: ModelEntry[]; chosen: string; choose: (key: string) => void; none?: string }) {
  return (
    <label class="full">{label}
      <select id={id} value={chosen} onChange={(event) => choose(event.currentTarget.value)}>
        {none !== undefined && <option value="">{none}</option>}
        {models.map((one) => {
          const key = keyOf(refOf(one));
          return <option key={key} value={key}>{t.models.line(one.session, one.subject, one.site, refOf(one).file, one.causes.length)}</option>;
        })}
      </select>
    </label>
  );
}

/** Where the numbers of ``model`` are from, how far they hold, and that they are of another than ``subject`` where they are. */
export function Origin({ model, subject }: { model: ModelEntry; subject: string }) {
  return (
    <div class={model.subject === subject ? "notice" : "notice warn"} id="origin">
      {model.subject !== subject && <p><strong>{t.models.other(model.subject, subject)}</strong></p>}
      <p>{t.models.origin(model.law, model.session, model.at ? date(model.at) : "")}</p>
      {refOf(model).file === "diagnosis" && <p>{t.models.diagnosed(model.causes.map((name) => name.replaceAll("_", " ")))}</p>}
      <p class="quiet">{t.models.holds(significant(model.force_N), significant(model.depth_mm), significant(model.rmse_N, 2))}</p>
    </div>
  );
}
