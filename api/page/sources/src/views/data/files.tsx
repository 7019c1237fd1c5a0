// Files or a folder, as they are chosen or dropped, copied to the bench's computer.
import { useRef, useState } from "preact/hooks";
import { post } from "../../api";
import { attempt } from "../../attempt";
import { start } from "../../jobs";
import { Start, whyNotWork } from "../../parts/may";
import { t } from "../../texts";

const MB = 1e6;
const SHOWN = 8;

/** The name with the folders it lies in, which tell recordings apart. */
const nameOf = (file: File) => file.webkitRelativePath || file.name;

function Chosen({ files }: { files: readonly File[] }) {
  if (!files.length) return null;
  const bytes = files.reduce((sum, file) => sum + file.size, 0);
  return (
    <div id="chosen" role="status">
      <p>{t.data.chosen(files.length, (bytes / MB).toFixed(1))}</p>
      <ul>
        {files.slice(0, SHOWN).map((file) => <li key={nameOf(file)}>{nameOf(file)}</li>)}
        {files.length > SHOWN && <li class="quiet">{t.data.more(files.length - SHOWN)}</li>}
      </ul>
    </div>
  );
}

export function Files({ begin }: { begin: (upload: string, job: string) => void }) {
  const [files, choose] = useState<File[]>([]);
  const [copying, copy] = useState(false);
  const [leftOut, leave] = useState<readonly string[]>([]);
  const form = useRef<HTMLFormElement>(null);
  const take = (taken: File[]) => {
    choose(taken);
    leave([]);
  };
  const chosen = (event: Event) => take([...((event.currentTarget as HTMLInputElement).files ?? [])]);
  const dropped = (event: DragEvent) => {
    event.preventDefault();
    if (event.dataTransfer?.files.length) take([...event.dataTransfer.files]);
  };
  const read = async (event: Event) => {
    event.preventDefault();
    copy(true);
    await attempt(async () => {
      const body = new FormData();
      for (const file of files) body.append("file", file, nameOf(file));
      const { id, left_out } = await post("/api/v1/uploads", { body: body as never });
      leave(left_out);
      begin(id, (await start("propose", { upload: id })).id);
    });
    copy(false);
  };
  return (
    <form ref={form} id="upload" class="drop" onSubmit={read} onDragOver={(event) => event.preventDefault()} onDrop={dropped}>
      <label>{t.data.choose}<input id="files" type="file" multiple onChange={chosen} /></label>
      <label>{t.data.chooseFolder}<input id="folder" type="file" multiple {...{ webkitdirectory: true }} onChange={chosen} /></label>
      <Start id="read" why={whyNotWork() || (files.length ? "" : t.data.noFile) || (copying ? t.data.copying : "")}>{t.data.read}</Start>
      <Chosen files={files} />
      {leftOut.length > 0 && <p id="left-out" class="notice warn" role="status">{t.data.leftOut(leftOut.slice(0, SHOWN), leftOut.length - SHOWN)}</p>}
    </form>
  );
}
