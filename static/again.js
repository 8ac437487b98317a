// Walks a scenario of the address once more on this server, and goes on to its replay in 3-D. A page of a sweep links here.

import { request } from "./requests.js";

const LOOK_AGAIN = 700; // ms
const element = (id) => document.getElementById(id);

/** The scenario after the # of the address; null where there is none. */
function scenarioOfAddress() {
  try {
    const scenario = JSON.parse(decodeURIComponent(location.hash.slice(1)));
    return typeof scenario === "object" ? scenario : null;
  } catch {
    return null;
  }
}

/** A scenario with its hardest push in words. */
function inWords({ robot = "The robot", duration, events = [] }) {
  const strengths = events.map(({ push }) => Math.hypot(...(push?.impulse ?? [0])));
  return `${robot} walks for ${Number(duration).toFixed(1)} s, and is pushed with ${Math.max(0, ...strengths).toFixed(1)} N·s.`;
}

/** Simulate, and show the replay in place of this page. It is asked for by a person: other sites may link here, too. */
async function walk(scenario) {
  element("walk").hidden = true;
  element("progress").hidden = false;
  let run = await request("POST", "runs", scenario);
  while (["queued", "running"].includes(run.status)) {
    element("progress").value = run.progress;
    element("state").textContent = run.status === "queued" ? "It waits for those before it." : "It walks …";
    await new Promise((done) => setTimeout(done, LOOK_AGAIN));
    run = await request("GET", `runs/${run.id}`);
  }
  if (!run.files.html) throw new Error(`It could not be walked: ${run.reason}`);
  element("state").textContent = "Its replay is made …";
  location.replace(run.files.html);
}

const scenario = scenarioOfAddress();
if (scenario) {
  element("name").textContent = scenario.name ?? "unnamed";
  element("what").textContent = inWords(scenario);
  element("walk").hidden = false;
  element("walk").addEventListener("click", () =>
    walk(scenario).catch((error) => {
      element("state").textContent = error.message;
      element("progress").hidden = true;
      element("walk").hidden = false;
    }),
  );
} else element("state").textContent = "There is no scenario in this address.";
addEventListener("hashchange", () => location.reload());
