// Menus for what a plot shows: a group of coordinates, and one or several of its members.

const mostCurves = 6;

function option(value, text, selected = false) {
  return element("option", { value, textContent: text, selected });
}

/// A menu of groups; hidden if there is only one.
function groupPicker(name, onChange) {
  const select = element("select", {}, ...groups.map((group, k) => option(k, group.label)));
  select.setAttribute("aria-label", `${name}: which coordinates`);
  select.hidden = groups.length < 2;
  select.addEventListener("change", onChange);
  return { node: select, get group() { return groups[select.value] ?? groups[0]; } };
}

/// A field for a whole number from 1 to `most`.
function numberPicker(label, start, onChange) {
  const input = element("input", { type: "number", min: 1, value: start, inputMode: "numeric" });
  input.setAttribute("aria-label", label);
  input.addEventListener("change", onChange);
  return {
    node: input,
    value(most) {
      input.max = most;
      const value = Math.min(Math.max(Math.round(Number(input.value)) || 1, 1), most);
      input.value = value;
      return value;
    },
  };
}

/// Picks a member of a group: by number in long chains, by name elsewhere.
class MemberPicker {
  constructor(name, onChange) {
    this.groups = groupPicker(name, () => {
      this.#fill();
      onChange();
    });
    this.select = element("select");
    this.select.setAttribute("aria-label", `${name}: which coordinate`);
    this.select.addEventListener("change", onChange);
    const last = groups[0]?.members.length ?? 1;
    this.number = numberPicker(`${name}: number of the link`, last, onChange);
    this.link = element("label", {}, "link ", this.number.node);
    this.nodes = [this.groups.node, this.select, this.link];
    this.#fill();
  }

  get group() {
    return this.groups.group;
  }

  get member() {
    const { members } = this.group;
    return members[this.link.hidden ? Number(this.select.value) : this.number.value(members.length) - 1];
  }

  #fill() {
    const { members } = this.group;
    const byNumber = members.length > 12;
    this.link.hidden = !byNumber;
    this.select.hidden = byNumber || members.length < 2;
    const named = byNumber ? [] : members.map((member, k) => option(k, symbol(member.name), k === members.length - 1));
    this.select.replaceChildren(...named);
    if (members.length === 1) this.select.replaceChildren(option(0, symbol(members[0].name), true));
  }
}

/// Picks several members of a group, from one to another; evenly spaced ones if there are many.
class RangePicker {
  constructor(name, onChange) {
    this.groups = groupPicker(name, onChange);
    this.from = numberPicker(`${name}: from number`, 1, onChange);
    this.to = numberPicker(`${name}: to number`, Math.max(...groups.map((group) => group.members.length)), onChange);
    this.range = element("label", {}, "links ", this.from.node);
    this.until = element("label", {}, "to ", this.to.node);
    this.nodes = [this.groups.node, this.range, this.until];
  }

  get group() {
    return this.groups.group;
  }

  get members() {
    const { members } = this.group;
    this.range.hidden = this.until.hidden = members.length <= mostCurves;
    const ends = [this.from.value(members.length), this.to.value(members.length)];
    if (members.length <= mostCurves) return members;
    const [low, high] = [Math.min(...ends) - 1, Math.max(...ends) - 1];
    const count = Math.min(mostCurves, high - low + 1);
    const at = (k) => low + Math.round((k * (high - low)) / Math.max(count - 1, 1));
    return Array.from({ length: count }, (_, k) => members[at(k)]);
  }
}
