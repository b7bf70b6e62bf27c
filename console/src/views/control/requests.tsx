// The requests of the operator, whatever the profile has.
import { possible } from "../../model/mission/mission";
import { texts } from "../../model/page";
import { reasonOf, verbText } from "../../model/mission/permission";
import { Panel } from "../../parts/panel";
import { AnswerOf, inOrder, RequestButton } from "./button";

export function Requests() {
  const t = texts.value.control;
  const told = possible.shown.value?.value.requests ?? [];
  const requests = told.filter(({ request }) => request.startsWith("operator.")).sort(inOrder);
  const refused = requests.filter((each) => reasonOf(each));
  return (
    <Panel title={t.requests} class="control-requests">
      {requests
        .filter((each) => !reasonOf(each))
        .map((each) => (
          <RequestButton key={each.verb} label={verbText(each.verb)} verb={each.verb} possible={each} />
        ))}
      {refused.map(({ verb }) => (
        <AnswerOf key={verb} verb={verb} mission="" />
      ))}
      {refused.length > 0 && (
        <details class="control-refused">
          <summary>{t.refused(refused.map(({ verb }) => verbText(verb)).join(", "))}</summary>
          {refused.map((each) => (
            <RequestButton key={each.verb} label={verbText(each.verb)} verb={each.verb} possible={each} apart />
          ))}
        </details>
      )}
    </Panel>
  );
}
