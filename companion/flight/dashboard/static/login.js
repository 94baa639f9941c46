import "./theme.js";

for (const why of ["refused", "wait"]) {
  document.getElementById(why).hidden = !location.search.includes(why);
}
