document.getElementById("refused").hidden = !location.search.includes("refused");
