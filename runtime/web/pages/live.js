// The live page of a run.
import { connect, say } from "./wire.js";

const grasp = document.getElementById("grasp");

connect({
  frame: (frame) => say(grasp, frame.grasp),
  closed: () => say(grasp, "not connected"),
});
