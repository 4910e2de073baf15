// What is dropped in: files and folders, one after the other, each with its progress and a button that breaks it off.

import { post, refresh } from "./ask.js";
import { button, el, notice, size } from "./dom.js";

const MOST_BYTES = 500e6;
let queue = Promise.resolve();

// One file, as its bytes go; the promise is rejected with a line where it did not arrive.
function send(name, file, bar, ending) {
  return new Promise((done, failed) => {
    const asked = new XMLHttpRequest();
    asked.open("PUT", `api/upload?name=${encodeURIComponent(name)}`);
    asked.upload.onprogress = (event) => { bar.max = event.total || 1; bar.value = event.loaded; };
    asked.onload = () => {
      if (asked.status === 200) return done(JSON.parse(asked.responseText).name);
      let line = asked.responseText;
      try { line = JSON.parse(line).error; } catch { /* one line of text */ }
      return failed(new Error(line));
    };
    asked.onerror = () => failed(new Error(`${name}: the upload broke off; drop it again`));
    asked.onabort = () => failed(new Error(""));
    ending.onclick = () => { ending.ended = true; asked.abort(); };
    if (ending.ended) return failed(new Error(""));
    return asked.send(file);
  });
}

// files: [name, File] of one thing that was dropped, a file or a folder of them.
async function sendAll(title, files, row) {
  const bar = el("progress", { value: 0, max: 1, "aria-label": `Upload of ${title}` });
  const ending = button("Cancel", () => { ending.ended = true; });
  const large = files.find(([, file]) => file.size > MOST_BYTES);
  row.replaceChildren(el("span", {}, `${title}, ${size(files.reduce((sum, [, file]) => sum + file.size, 0))}`), bar, ending);
  try {
    if (large) throw new Error(`${large[0]}: is larger than 500 MB; open it where it lies, with flownav info`);
    const inFolder = files[0][0].includes("/");
    const folder = inFolder ? (await post("api/folder", { name: title })).name : "";
    for (const [name, file] of files) {
      await send(inFolder ? `${folder}/${name.split("/").slice(1).join("/")}` : name, file, bar, ending);
    }
  } catch (error) {
    if (error.message) notice(error.message);
  }
  row.remove();
  await refresh();
}

export function upload(dropped, list) {
  for (const [title, files] of dropped) {
    const row = el("li", {}, `${title} waits`);
    list.append(row);
    queue = queue.then(() => sendAll(title, files, row));
  }
}

// Things that were chosen by a dialogue: those of a folder have a relative path.
export function chosen(files) {
  const found = new Map();
  for (const file of files) {
    const name = file.webkitRelativePath || file.name;
    const title = name.split("/")[0];
    found.set(title, [...(found.get(title) || []), [name, file]]);
  }
  return found;
}

// Things that were dropped; a folder's files are read, those of folders inside it as well.
export async function dropped(transfer) {
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry && item.webkitGetAsEntry()).filter(Boolean);
  if (!entries.length) return chosen(transfer.files);
  const found = new Map();
  for (const entry of entries) found.set(entry.name, await inside(entry, ""));
  return found;
}

async function inside(entry, before) {
  const name = before + entry.name;
  if (entry.isFile) return [[name, await new Promise((done, failed) => entry.file(done, failed))]];
  const reader = entry.createReader(), files = [];
  for (;;) {
    const some = await new Promise((done, failed) => reader.readEntries(done, failed));
    if (!some.length) return files;
    for (const each of some) files.push(...await inside(each, `${name}/`));
  }
}
