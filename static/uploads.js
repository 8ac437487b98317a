// Recordings from elsewhere: a file that is chosen or dropped on the page becomes a run of the server, and is opened.

import { notify } from "./notices.js";
import { request } from "./requests.js";
import { zip } from "./zip.js";

const KINDS = [".npz", ".parquet", ".mcap", ".csv"]; // the better of several in one folder first
const RUN_JSON = "run.json";
const WHAT = "a recording (.npz, .csv, .parquet, .mcap, or a .zip), with the run.json beside it";

const element = (id) => document.getElementById(id);

export class Uploads {
  /**
   * @param {object} options
   * @param {import("./timeline.js").Timeline} options.timeline shows what was uploaded
   * @param {() => string} options.robot name of the robot in the scene
   * @param {(error: Error) => void} options.onError
   */
  constructor({ timeline, robot, onError }) {
    Object.assign(this, { timeline, robot, onError });
    this.button = element("open-file");
    const input = element("recording-file");
    this.button.addEventListener("click", () => input.click());
    input.addEventListener("change", async () => {
      await this.take([...input.files]);
      input.value = ""; // so that the same file can be chosen again
    });
    this.attach(window);
  }

  /** Take files that are dropped on a window. */
  attach({ document }) {
    const mark = (isOver) => window.document.body.classList.toggle("is-dropping", isOver);
    document.addEventListener("dragover", (event) => {
      if (!event.dataTransfer?.types.includes("Files")) return;
      event.preventDefault();
      event.dataTransfer.dropEffect = "copy";
      mark(true);
    });
    document.addEventListener("dragleave", ({ relatedTarget }) => relatedTarget === null && mark(false));
    document.addEventListener("drop", async (event) => {
      mark(false);
      if (!event.dataTransfer?.types.includes("Files")) return;
      event.preventDefault(); // else the browser would leave the page for the file
      await this.take(await dropped(event.dataTransfer));
    });
  }

  /** Upload the recording among some files, and open it. */
  async take(files) {
    if (document.body.classList.contains("only-looks")) return;
    const { recording, run } = chosen(files);
    if (!recording) return notify(`There is no recording here: choose ${WHAT}.`, { level: "bad" });
    this.button.disabled = true; // while it takes its time
    try {
      const body = run ? await zip([recording, run]) : recording;
      const query = new URLSearchParams({ name: nameOf(recording), robot: this.robot() });
      const uploaded = await request("POST", `runs/upload?${query}`, body);
      if (uploaded.robot === this.robot()) await this.show(uploaded);
      else this.offerRobot(uploaded);
    } catch (error) {
      this.onError(error);
    } finally {
      this.button.disabled = false;
    }
  }

  async show({ id }) {
    this.timeline.toggle(true);
    await this.timeline.listRuns();
    await this.timeline.open(id);
  }

  /** Only walks of the robot in the scene can be shown there. */
  offerRobot({ name, robot }) {
    const change = () => request("PUT", "live/robot", { robot }).catch(this.onError);
    const actions = [{ text: `Let ${robot} walk`, onClick: change }];
    notify(`“${name}” is a walk of ${robot}. It can be opened in the time line once that robot walks here.`, { actions });
  }
}

/** The best recording of some files, and the run.json beside it. */
function chosen(files) {
  const is = (ending) => files.find(({ name }) => name.toLowerCase().endsWith(ending));
  const recording = [".zip", ...KINDS].map(is).find(Boolean);
  const hasItself = recording && [".zip", ".parquet", ".mcap"].some((ending) => recording.name.toLowerCase().endsWith(ending));
  return { recording, run: hasItself ? undefined : files.find(({ name }) => name === RUN_JSON) };
}

function nameOf({ name }) {
  const stem = name.replace(/\.[^.]*$/, "");
  return stem === "recording" ? "" : stem.slice(0, 200); // as `walk run` names all of them: the scenario's name tells more
}

/** The files of a drop, those of a folder too. */
async function dropped({ items, files }) {
  const loose = [...files]; // now: after the event there are none
  const folders = [...items].map((item) => item.webkitGetAsEntry?.()).filter((entry) => entry?.isDirectory);
  const inside = await Promise.all(folders.map(filesOf));
  return folders.length ? inside.flat() : loose;
}

async function filesOf(folder) {
  const reader = folder.createReader();
  const entries = [];
  let more;
  do {
    more = await new Promise((take, fail) => reader.readEntries(take, fail)); // a browser tells 100 of them at a time
    entries.push(...more);
  } while (more.length);
  const wanted = entries.filter(({ isFile, name }) => isFile && (name === RUN_JSON || KINDS.some((kind) => name.endsWith(kind))));
  return Promise.all(wanted.map((entry) => new Promise((take, fail) => entry.file(take, fail))));
}
