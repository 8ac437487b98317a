// Render quality of the scene: less to draw where there is no graphics card, unless a person chose.

const KEY = "walk.look";
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;
const MIN_FRAME_RATE = 14; // frames/s
const MAX_SLOW_WINDOWS = 3; // in a row
const WINDOW = 3000; // ms

/** @returns {"auto" | "full" | "light"} choice of a person, "auto" by default */
export const chosenQuality = () => localStorage.getItem(KEY) ?? "auto";

export function chooseQuality(quality) {
  if (quality === "auto") localStorage.removeItem(KEY);
  else localStorage.setItem(KEY, quality);
}

/** @returns {"full" | "light"} what was chosen, or what suits this machine */
export function suitableQuality() {
  const chosen = chosenQuality();
  return chosen === "auto" ? (rendersInSoftware() ? "light" : "full") : chosen;
}

function rendersInSoftware() {
  const context = document.createElement("canvas").getContext("webgl2");
  if (!context) return true;
  const info = context.getExtension("WEBGL_debug_renderer_info");
  const renderer = context.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : context.RENDERER);
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return SOFTWARE.test(renderer);
}

/** Count the frames of a window, and call `onSlow` once when they stay few. */
export function watchFrameRate(target, onSlow) {
  let frames = 0;
  let slowWindows = 0;
  const count = () => {
    frames += 1;
    target.requestAnimationFrame(count);
  };
  target.requestAnimationFrame(count);
  const check = setInterval(() => {
    if (target.closed) return clearInterval(check);
    slowWindows = document.hidden || frames >= (MIN_FRAME_RATE * WINDOW) / 1000 ? 0 : slowWindows + 1;
    frames = 0;
    if (slowWindows < MAX_SLOW_WINDOWS) return;
    clearInterval(check);
    onSlow();
  }, WINDOW);
  return () => clearInterval(check);
}
