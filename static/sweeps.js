// List of the sweeps of this server: how far each is, its page, and a button that ends or removes it.

import { request } from "./requests.js";

const LOOK_AGAIN = 2000; // ms
const list = document.getElementById("sweeps");
const state = document.getElementById("state");

function progress({ status, reason, nb_done, nb_cells, time_left }) {
  if (status === "running") {
    const left = time_left === null ? "" : `, ${time_left < 90 ? `${Math.round(time_left)} s` : `${Math.round(time_left / 60)} min`} left`;
    return `${nb_done} of ${nb_cells} cells${left}`;
  }
  return `${status}, ${nb_cells} cells${reason ? `: ${reason}` : ""}`;
}

function row(sweep) {
  const made = document.createElement("li");
  const name = Object.assign(document.createElement("strong"), { textContent: sweep.name });
  const page = Object.assign(document.createElement("a"), { textContent: "what came of it", href: sweep.files.page ?? "" });
  page.hidden = !sweep.files.page;
  const word = ["queued", "running"].includes(sweep.status) ? "Cancel" : "Remove";
  const end = Object.assign(document.createElement("button"), { type: "button", textContent: word });
  end.ariaLabel = `${word} ${sweep.name}`;
  end.addEventListener("click", () => request("DELETE", `sweeps/${sweep.id}`).then(show).catch(tell));
  made.append(name, page, end, Object.assign(document.createElement("small"), { textContent: progress(sweep) }));
  return made;
}

function tell(error) {
  state.textContent = error.message;
}

let shown = "";
async function show() {
  const sweeps = await request("GET", "sweeps");
  state.textContent = sweeps.length ? "" : "There is none yet.";
  const present = JSON.stringify(sweeps);
  if (present === shown) return; // a button keeps its focus
  shown = present;
  list.replaceChildren(...sweeps.map(row));
}

async function follow() {
  await show().catch(tell);
  setTimeout(follow, LOOK_AGAIN);
}
follow();
