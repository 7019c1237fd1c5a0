// Pictures that the report has too, each with what it shows.
import { t } from "../texts";

export function Pictures({ session, folder, names, on }: { session: string; folder: string; names: readonly string[]; on: string }) {
  const base = `/api/v1/recordings/${encodeURIComponent(session)}/${folder}`;
  return (
    <div class="pictures">
      {names.map((name) => (
        <details key={name} open={name === names[0]}>
          <summary>{t.pictures[name] ?? name}</summary>
          <img class="figure" loading="lazy" src={`${base}/${name}.svg?${on}`} alt={t.pictures[name] ?? name} onError={(event) => { event.currentTarget.replaceWith(t.noPicture); }} />
        </details>
      ))}
    </div>
  );
}
