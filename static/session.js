// What can be taken along: a link to what was chosen, and the last minute as a recording.

import { ask } from "./rest.js";
import { notify } from "./notices.js";

const REFERENCE = { vx: "reference_vx", vy: "reference_vy", yaw_rate: "reference_yaw_rate" };
const LAYERS = { show: true, hide: false }; // names with blanks between them
const HELD_BY = ["sliders", "rest"]; // drivers whose reference stays

/** An address that carries the parameters and layers that are not the server's own, the speed of time, and a reference that is held. */
export async function copyLink(live) {
  const [chosen, layers] = await Promise.all([changed("live/parameters"), changed("live/layers")]);
  for (const [key, isShown] of Object.entries(LAYERS)) {
    const names = layers.filter(([, value]) => value === isShown).map(([name]) => name);
    if (names.length) chosen.push([key, names.join(" ")]);
  }
  if ((live.speed ?? 1) !== 1) chosen.push(["speed", live.speed]);
  if (HELD_BY.includes(live.driver)) {
    for (const [name, key] of Object.entries(REFERENCE)) if (live[key]) chosen.push([name, Math.round(1e3 * live[key]) / 1e3]);
  }
  const link = new URL(location.pathname, location);
  link.hash = new URLSearchParams(chosen);
  const isCopied = await copied(link.href);
  const what = chosen.length ? `: ${inWords(chosen)}` : ". Everything is as the server began";
  notify(`${isCopied ? "Link copied" : "The link"}${what}.`, { actions: isCopied ? [] : [{ text: link.href, href: link.href }] });
}

/** What is not as the server began, as pairs. */
async function changed(path) {
  const [now, defaults] = await Promise.all([ask("GET", path), ask("GET", `${path}/defaults`)]);
  return Object.entries(now).filter(([name, value]) => value !== defaults[name]);
}

/** The clipboard is closed to pages that come neither by https nor from this machine. */
async function copied(text) {
  if (!navigator.clipboard) return false;
  return navigator.clipboard.writeText(text).then(() => true, () => false);
}

/** Offer what the address asks for: a button, because it changes the robot for everybody. */
export async function offerLink() {
  const asked = Object.fromEntries([...new URLSearchParams(location.hash.slice(1))].map(([name, text]) => [name, value(text)]));
  if (!Object.keys(asked).length) return;
  const forget = () => history.replaceState(null, "", location.pathname);
  const { speed, vx, vy, yaw_rate, show, hide, ...parameters } = asked;
  const apply = async () => {
    forget();
    if (Object.keys(parameters).length) await ask("PATCH", "live/parameters", parameters);
    const layers = { ...switched(show, LAYERS.show), ...switched(hide, LAYERS.hide) };
    if (Object.keys(layers).length) await ask("PATCH", "live/layers", layers);
    if (speed !== undefined) await ask("POST", "live/speed", { factor: speed });
    const reference = Object.fromEntries(Object.entries({ vx, vy, yaw_rate }).filter(([, part]) => part !== undefined));
    if (Object.keys(reference).length) await ask("PUT", "live/reference", reference);
    notify("Applied.");
  };
  notify(`This link asks for ${inWords(Object.entries(asked))}. It changes the robot for everybody who watches.`, {
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

/** The last minute of this robot, as a recording that others open. */
export async function save() {
  const run = await ask("POST", "live/save", {});
  const files = Object.entries(run.files).map(([ending, href]) => ({ text: ending, href }));
  notify(`Saved the last ${Math.round(run.duration)} s as “${run.name}”.`, { actions: files });
}
