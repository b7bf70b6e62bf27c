// What tells at once that this is no robot, on every view: a stripe with the word, and the controls of its time.
import { useState } from "preact/hooks";
import { useTopic } from "../model/topics";
import { chart } from "../model/mission/mission";
import { gateway, mode, texts } from "../model/page";
import { moment } from "../model/time/past";
import { extent, play, playing, playSpeed, SPEEDS } from "../model/time/playback";
import { said, simulate, simulated } from "../model/mission/simulation";
import { number } from "./format";
import "./virtual.css";

const SIMULATION_SPEEDS = ["0.1", "0.5", "1", "2", "5", "10", "20", "50", "100"] as const;

export function VirtualBar() {
  const now = mode.value;
  if (now === "robot") return null;
  return (
    <div class={`virtual ${now}`}>
      <strong class="virtual-word">{texts.value.shell.modes[now]}</strong>
      <span>{gateway.value?.title}</span>
      {now === "simulation" ? <Transport /> : <Playback />}
    </div>
  );
}

function Transport() {
  const t = texts.value.simulation;
  const now = simulated.value;
  if (!now) return null;
  const word = now.running ? t.pause : t.run;
  return (
    <>
      <span class="row" role="group" aria-label={t.transport}>
        <button class="main" onClick={() => void simulate(now.running ? "pause" : "run")}>
          <span aria-hidden="true">{now.running ? "❚❚" : "▶"}</span> {word}
        </button>
        <button onClick={() => void simulate("step")}>
          <span aria-hidden="true">⇥</span> {t.step}
        </button>
        <label>
          {t.speed}{" "}
          <select value={String(now.speed ?? "max")} onChange={(event) => void simulate("speed", event.currentTarget.value)}>
            {now.speed !== null && !SIMULATION_SPEEDS.some((each) => Number(each) === now.speed) && (
              <option value={String(now.speed)}>{number(now.speed)}×</option>
            )}
            {SIMULATION_SPEEDS.map((each) => (
              <option value={each}>{each}×</option>
            ))}
            <option value="max">{t.asFast}</option>
          </select>
        </label>
        <Until />
        <button onClick={() => void simulate("again")}>
          <span aria-hidden="true">↺</span> {t.again}
        </button>
      </span>
      <span class="virtual-time" title={now.clock}>
        {t.seconds(number(now.time))} {now.until && t.runsUntil(now.until)}
      </span>
      <span role="status" class={said.value?.success === false ? "bad" : "soft"}>
        {said.value?.success === false ? said.value.text : now.note}
      </span>
    </>
  );
}

function Until() {
  const t = texts.value.simulation;
  const known = useTopic(chart)?.value.states ?? {};
  const [state, setState] = useState("");
  return (
    <form
      class="row"
      onSubmit={(event) => {
        event.preventDefault();
        void simulate("until", state);
      }}
    >
      <input list="virtual-states" aria-label={t.until} placeholder={t.until} value={state} onInput={(event) => setState(event.currentTarget.value)} />
      <datalist id="virtual-states">
        {Object.keys(known).map((each) => (
          <option value={each} />
        ))}
      </datalist>
      <button disabled={!state}>{t.runUntil}</button>
    </form>
  );
}

function Playback() {
  const t = texts.value.recording;
  const { from, to } = extent();
  const problems = gateway.value?.problems ?? [];
  const at = moment.value ?? to;
  return (
    <>
      <span class="row" role="group" aria-label={t.playback}>
        <button onClick={() => (moment.value = from)}>
          <span aria-hidden="true">⇤</span> {t.toBegin}
        </button>
        <button class="main" onClick={() => (playing.value ? (playing.value = false) : play())}>
          <span aria-hidden="true">{playing.value ? "❚❚" : "▶"}</span> {playing.value ? t.pause : t.play}
        </button>
        <label>
          {t.speed}{" "}
          <select value={playSpeed.value} onChange={(event) => (playSpeed.value = Number(event.currentTarget.value))}>
            {SPEEDS.map((each) => (
              <option value={each}>{each}×</option>
            ))}
          </select>
        </label>
        <button onClick={() => ((playing.value = false), (moment.value = null))}>
          <span aria-hidden="true">⇥</span> {t.toEnd}
        </button>
      </span>
      <span class="virtual-time">
        {number((at - from) / 1000)} / {number((to - from) / 1000)} s
      </span>
      {problems.length > 0 && (
        <details class="virtual-problems" open>
          <summary>{t.problems}</summary>
          <ul>
            {problems.map((each) => (
              <li>{each}</li>
            ))}
          </ul>
        </details>
      )}
    </>
  );
}
