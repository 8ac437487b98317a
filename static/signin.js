// The form for the token: where to go on to, and whether the token was wrong.

const query = new URLSearchParams(location.search);
document.getElementById("wrong").hidden = !query.has("wrong");
document.forms[0].elements.next.value = (query.get("next") ?? "/") + location.hash;
