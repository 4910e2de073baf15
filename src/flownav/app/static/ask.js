// Requests to the server that the page came from, and its state, which is read again while something runs.

import { notice } from "./dom.js";

const readers = new Set();
export let state = { folder: "", files: [], jobs: [], saying: "" };
let timer = 0, shown = "";

export async function request(path, options = {}) {
  let answer;
  try {
    answer = await fetch(path, options);
  } catch {
    throw new Error("flownav app does not answer any more; start it again");
  }
  const text = await answer.text();
  let found = null;
  try { found = JSON.parse(text); } catch { /* one line of text */ }
  if (!answer.ok) throw new Error(found?.error || text.trim() || `status ${answer.status}`);
  return found;
}

export const post = (path, asked) =>
  request(path, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(asked) });

export const fileUrl = (name) => `files/${name.split("/").map(encodeURIComponent).join("/")}`;

// Begin a job, or tell why it cannot begin.
export async function start(kind, asked) {
  try {
    const job = await post("api/jobs", { kind, ...asked });
    await refresh();
    return job;
  } catch (error) {
    notice(error.message);
    return null;
  }
}

export async function act(doing) {
  try { await doing(); } catch (error) { notice(error.message); }
  await refresh();
}

export function follow(reader) { readers.add(reader); reader(state); return () => readers.delete(reader); }

export const isBusy = () =>
  state.files.some((file) => file.looking) || state.jobs.some((job) => ["queued", "running"].includes(job.state));

export async function refresh() {
  clearTimeout(timer);
  try {
    const found = await request("api/state");
    const text = JSON.stringify(found);
    if (text !== shown) {
      [state, shown] = [found, text];
      readers.forEach((reader) => reader(state));
    }
  } catch (error) {
    notice(error.message);
  }
  timer = setTimeout(refresh, isBusy() ? 700 : 4000);
}
