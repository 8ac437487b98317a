// The form for the token: where to go on to, and whether the token was wrong.

const query = new URLSearchParams(location.search);
const problem = document.getElementById("wrong");
problem.hidden = !query.has("wrong") && !query.has("wait");
if (query.has("wait")) problem.textContent = `Too many wrong tokens. Try again in ${Number(query.get("wait"))} s.`;
document.forms[0].elements.next.value = (query.get("next") ?? "/") + location.hash;
