// Sheets over the page: opened as modal dialogs, closed by their cross, Escape, or a click beside them.

export const isSheetOpen = () => document.querySelector("dialog[open]") !== null;

/** @param {HTMLDialogElement} dialog; another sheet that is open gives way to it */
export function openSheet(dialog) {
  document.querySelector("dialog[open]")?.close();
  dialog.showModal();
}

for (const dialog of document.querySelectorAll("dialog")) {
  dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
  dialog.querySelector(".close").addEventListener("click", () => dialog.close());
}
