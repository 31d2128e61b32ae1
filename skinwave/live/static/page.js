// The page: reads its data and shows it.

const data = JSON.parse(document.getElementById("data").textContent);
document.getElementById("app").textContent = data.bodies.map((body) => body.title).join(", ");
