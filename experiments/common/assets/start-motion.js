
"use strict";
const { player, panels } = buildMotion(document.getElementById("main"));
