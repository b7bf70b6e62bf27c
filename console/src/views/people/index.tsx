import { texts } from "../../model/page";
import { Panel } from "../../parts/panel";

export function PeopleView() {
  return <Panel title={texts.value.people.title}>…</Panel>;
}
