// Mission control: where the mission stands, what to do, and every request with the reason why it cannot be asked for.
import "./control.css";
import { Questions } from "./questions";
import { Requests } from "./requests";
import { RunningNow } from "./running";
import { Starts } from "./starts";
import { ToDo, Where } from "./status";

export function ControlView() {
  return (
    <div class="control">
      <div>
        <Questions />
        <Where />
        <ToDo />
      </div>
      <div>
        <Requests />
        <Starts />
      </div>
      <div>
        <RunningNow />
      </div>
    </div>
  );
}
