// How much the scene has to draw here: less where there is no graphics card, chosen by itself.

const KEY = "walk.look";
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;
const SLOW = 14; // frames/s
const PATIENCE = 3; // slow windows in a row
const WINDOW = 3000; // ms

/** @returns {"auto" | "full" | "light"} what was chosen by hand, or that nothing was */
export const chosenLook = () => localStorage.getItem(KEY) ?? "auto";

export function chooseLook(look) {
  if (look === "auto") localStorage.removeItem(KEY);
  else localStorage.setItem(KEY, look);
}

/** @returns {"full" | "light"} */
export function suitableLook() {
  const chosen = chosenLook();
  return chosen === "auto" ? (rendersInSoftware() ? "light" : "full") : chosen;
}

function rendersInSoftware() {
  const context = document.createElement("canvas").getContext("webgl2");
  if (!context) return true;
  const about = context.getExtension("WEBGL_debug_renderer_info");
  const renderer = context.getParameter(about ? about.UNMASKED_RENDERER_WEBGL : context.RENDERER);
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return SOFTWARE.test(renderer);
}

/** Counts the frames of a window, and tells once when they stay few. */
export function watchFrames(target, onSlow) {
  let frames = 0;
  let slow = 0;
  const count = () => {
    frames += 1;
    target.requestAnimationFrame(count);
  };
  target.requestAnimationFrame(count);
  const check = setInterval(() => {
    if (target.closed) return clearInterval(check);
    slow = document.hidden || frames >= (SLOW * WINDOW) / 1000 ? 0 : slow + 1;
    frames = 0;
    if (slow < PATIENCE) return;
    clearInterval(check);
    onSlow();
  }, WINDOW);
  return () => clearInterval(check);
}
