// The grasp as a whole: internal and external force, width, grip force now, needed and allowed, object, speed of the arm.

import { UNKNOWN, Rows, isNumber, parts, quantity, withSpread } from "./format.js";
import { drawGrip } from "./gauges.js";

const yesOrNo = (value, yes, no) => (value === true ? yes : value === false ? no : UNKNOWN);

export class GraspCard {
  constructor(adjust_n, onAdjust) {
    this.element = document.getElementById("grasp");
    this.canvas = document.getElementById("grip");
    this.drawn = null;
    this.buttons = document.getElementById("grip-buttons");
    this.rows = new Rows(document.getElementById("grasp-values"), "grasp");
    for (const [id, delta_n, text] of [["less", -adjust_n, "−"], ["more", adjust_n, "+"]]) {
      const button = document.getElementById(id);
      button.textContent = `Grip ${text}${adjust_n} N`;
      button.addEventListener("click", () => onAdjust(delta_n));
    }
  }

  draw(state) {
    const exists = state.last("grasp") || state.last("gripper");
    this.element.hidden = !exists;
    if (!exists) return;
    const [grasp, gripper] = [state.fresh("grasp"), state.fresh("gripper")];
    const { rows } = this;
    if (state.last("grasp")) this.#drawGrasp(grasp);
    if (state.last("status")?.streams?.arm) this.#drawMotion(grasp?.object, state.fresh("motion"));
    if (state.last("gripper")) this.#drawGripper(gripper);
    const now_n = grasp ? grasp.internal_n : gripper?.force_n;
    this.drawn = drawGrip(this.canvas, now_n, grasp?.grip_needed_n, gripper?.force_limit_n);
    rows.set("width", quantity(grasp?.width_m ?? gripper?.width_m, 1, "mm", 1000), "width_m");
  }

  #drawGrasp(grasp) {
    const { rows } = this;
    rows.set("grip force now (internal)", quantity(grasp?.internal_n, 2, "N"), "internal_n");
    rows.set("grip force needed", quantity(grasp?.grip_needed_n, 2, "N"), "grip_needed_n");
    rows.set("external force", parts(grasp?.external_force_n, 2, "N"), "external_force_n");
    rows.set("external torque", parts(grasp?.external_torque_nm, 3, "N·m"), "external_torque_nm");
    const share = grasp?.load_share;
    const shares = share && Object.values(share).every(isNumber)
      ? Object.entries(share).map(([finger, part]) => `${finger} ${quantity(part, 0, "%", 100)}`).join(", ")
      : UNKNOWN;
    rows.set("share of the load", shares, "load_share");
    rows.set("asymmetry", quantity(grasp?.asymmetry, 2), "asymmetry");
  }

  #drawMotion(object, motion) {
    const { rows } = this;
    rows.set("object", withSpread(object?.mass_kg, object?.mass_std_kg, 3, "kg"), "mass_kg", object?.unknown);
    rows.set("speed that holds", quantity(motion?.speed_scale, 0, "%", 100), "speed_scale", motion?.unknown);
    const limit = quantity(motion?.acceleration_limit_mps2, 1, "m/s²");
    rows.set("acceleration that holds", limit, "acceleration_limit_mps2", motion?.unknown);
  }

  #drawGripper(gripper) {
    const { rows } = this;
    rows.set("commanded", quantity(gripper?.force_command_n, 1, "N"), "force_command_n");
    rows.set("limit", gripper && gripper.force_limit_n === null ? "none may be requested" : quantity(gripper?.force_limit_n, 1, "N"), "force_limit_n");
    const fault = gripper?.latched_fault || gripper?.fault;
    const condition = gripper
      ? [yesOrNo(gripper.active, "active", "not active"), yesOrNo(gripper.moving, "moving", "at rest"),
        `object ${gripper.object ?? UNKNOWN}`, fault && `fault: ${fault}`].filter(Boolean).join(", ")
      : UNKNOWN;
    rows.set("gripper", condition, "gripper");
    const held = gripper?.lease?.held;
    rows.set("lease", yesOrNo(held, "held by a client", "free"), "lease");
  }
}
