// Modal dialogs over the page, closed by their cross, Escape, or a click beside them.

export const isDialogOpen = () => document.querySelector("dialog[open]") !== null;

/** @param {HTMLDialogElement} dialog; closes another one that is open */
export function openDialog(dialog) {
  document.querySelector("dialog[open]")?.close();
  dialog.showModal();
}

for (const dialog of document.querySelectorAll("dialog")) {
  dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
  dialog.querySelector(".close").addEventListener("click", () => dialog.close());
}
