// Short messages at the edge of the page, which disappear by themselves.

const SHOWN_FOR = 7000; // ms
const WITH_BUTTONS_FOR = 30000; // ms
const MOST = 3; // at a time

const list = document.getElementById("notices");

/**
 * @param {string} text
 * @param {{level?: "plain" | "bad", actions?: {text: string, href?: string, onClick?: () => void}[]}} [options]
 */
export function notify(text, { level = "plain", actions = [] } = {}) {
  const notice = document.createElement("div");
  notice.className = "notice";
  notice.dataset.level = level;
  const message = document.createElement("p");
  message.textContent = text;
  notice.append(message, ...actions.map((action) => control(action, notice)), closer(notice));
  const same = [...list.children].find((other) => other.firstChild.textContent === text);
  same?.remove();
  list.append(notice);
  while (list.children.length > MOST) list.firstChild.remove();
  setTimeout(() => notice.remove(), actions.length ? WITH_BUTTONS_FOR : SHOWN_FOR);
}

function control({ text, href, onClick }, notice) {
  const element = document.createElement(href ? "a" : "button");
  element.textContent = text;
  if (href) {
    element.href = href;
    element.target = "_blank";
  } else {
    element.type = "button";
    element.addEventListener("click", () => {
      notice.remove();
      onClick();
    });
  }
  return element;
}

function closer(notice) {
  const button = document.createElement("button");
  Object.assign(button, { className: "close", type: "button", textContent: "×", ariaLabel: "Dismiss" });
  button.addEventListener("click", () => notice.remove());
  return button;
}
