// Sharing: a link to the choices made here, and the last minute as a recording.

import { request } from "./requests.js";
import { notify } from "./notices.js";
import { DEFAULT_VIEW } from "./views.js";

const REFERENCE = { vx: "reference_vx", vy: "reference_vy", yaw_rate: "reference_yaw_rate" };
const LAYERS = { show: true, hide: false }; // names with blanks between them
const HOLDING = ["sliders", "rest"]; // drivers whose reference stays until it is changed

/** Copy an address with what differs from the server's own: parameters, layers, speed, a reference that is held, this view. */
export async function copyLink(live, view, client) {
  const parts = ["robot", "parameters", `layers?client=${client}`];
  const [robot, chosen, layers] = await Promise.all(parts.map((part) => changed(`live/${part}`)));
  const name = robot.find(([key]) => key === "name");
  if (name) chosen.unshift(["robot", name[1]]);
  for (const [key, isShown] of Object.entries(LAYERS)) {
    const names = layers.filter(([, value]) => value === isShown).map(([name]) => name);
    if (names.length) chosen.push([key, names.join(" ")]);
  }
  if ((live.speed ?? 1) !== 1) chosen.push(["speed", live.speed]);
  if (HOLDING.includes(live.driver)) {
    for (const [name, key] of Object.entries(REFERENCE)) if (live[key]) chosen.push([name, Math.round(1e3 * live[key]) / 1e3]);
  }
  if (view !== DEFAULT_VIEW) chosen.push(["view", view]);
  const link = new URL(location.pathname, location);
  link.hash = new URLSearchParams(chosen);
  const isCopied = await copied(link.href);
  const what = chosen.length ? `: ${inWords(chosen)}` : ". Everything is as when the server started";
  notify(`${isCopied ? "Link copied" : "The link"}${what}.`, { actions: isCopied ? [] : [{ text: link.href, href: link.href }] });
}

/** Values that differ from those that the server started with, as pairs. */
async function changed(path) {
  const [now, defaults] = await Promise.all([request("GET", path), request("GET", `${path.split("?")[0]}/defaults`)]);
  return Object.entries(now).filter(([name, value]) => value !== defaults[name]);
}

/** Copy a text; the clipboard is closed to pages that come neither by https nor from this machine. */
async function copied(text) {
  if (!navigator.clipboard) return false;
  return navigator.clipboard.writeText(text).then(() => true, () => false);
}

/** Take the view in the address, and offer to apply its other choices: by a button, because they are for everybody. */
export async function offerLink({ client, onView, onPreset, presets, onLesson }) {
  const parts = [location.search, location.hash].flatMap((text) => [...new URLSearchParams(text.slice(1))]);
  const { view, preset, lesson, booth, ...choices } = Object.fromEntries(parts.map(([name, text]) => [name, value(text)]));
  const forget = () => history.replaceState(null, "", location.pathname + (booth === undefined ? "" : location.search));
  if (view !== undefined) onView(view);
  if (lesson !== undefined) onLesson(String(lesson));
  if (preset in presets) {
    const actions = [{ text: "Play", onClick: () => onPreset(preset).catch((error) => notify(error.message, { level: "bad" })) }];
    forget();
    notify(`${presets[preset].title}: it starts the robot anew for everybody who watches.`, { actions });
    return;
  }
  if (!Object.keys(choices).length) return forget();
  const { robot, speed, vx, vy, yaw_rate, show, hide, ...parameters } = choices;
  const layers = { ...switched(show, LAYERS.show), ...switched(hide, LAYERS.hide) };
  if (Object.keys(layers).length) {
    // Like the view these are of this browser alone.
    await request("PATCH", `live/layers?client=${client}`, layers).catch((error) => notify(error.message, { level: "bad" }));
  }
  const shared = Object.entries(choices).filter(([name]) => !(name in LAYERS));
  if (!shared.length) return forget();
  const apply = async () => {
    forget();
    if (robot !== undefined) await request("PUT", "live/robot", { robot }); // the rest is of it
    if (Object.keys(parameters).length) await request("PATCH", "live/parameters", parameters);
    if (speed !== undefined) await request("POST", "live/speed", { factor: speed });
    const reference = Object.fromEntries(Object.entries({ vx, vy, yaw_rate }).filter(([, part]) => part !== undefined));
    if (Object.keys(reference).length) await request("PUT", "live/reference", reference);
    notify("Applied.");
  };
  notify(`This link asks for ${inWords(shared)}. It changes the robot for everybody who watches.`, {
    actions: [
      { text: "Apply", onClick: () => apply().catch((error) => notify(error.message, { level: "bad" })) },
      { text: "Leave it", onClick: forget },
    ],
  });
}

const switched = (names, isShown) => Object.fromEntries(names?.split(" ").map((name) => [name, isShown]) ?? []);

function value(text) {
  try {
    return JSON.parse(text); // a number, true, false or null
  } catch {
    return text;
  }
}

const inWords = (pairs) => pairs.map(([name, part]) => `${name} ${part}`.replaceAll("_", " ")).join(", ");

const FILES = { html: "3-D replay", parquet: "data (Parquet)", csv: "data (CSV)", npz: "data (NumPy)", mcap: "data (MCAP, Foxglove)", json: "parameters" };

/** Save the last minute of this robot, or the walk that `options` name, as a recording, and offer the replay first. */
export async function saveRecording(options = {}) {
  const run = await request("POST", "live/save", options);
  const files = Object.entries(run.files).map(([ending, href]) => ({ text: FILES[ending] ?? ending, href, isFirst: ending === "html" }));
  files.sort((one, other) => other.isFirst - one.isFirst);
  notify(`Saved the last ${Math.round(run.duration)} s as “${run.name}”.`, { actions: files });
}
