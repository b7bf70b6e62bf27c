// A short sound when there is something new to know of; off unless somebody switches it on.
import { effect, signal } from "@preact/signals";
import { openNotifications } from "../../model/people";

const KEPT = "lupin.sound";
const SECONDS = 0.25;

export const sound = signal(localStorage.getItem(KEPT) === "on");
let before = 0;

sound.subscribe((on) => localStorage.setItem(KEPT, on ? "on" : "off"));

effect(() => {
  const newest = Math.max(0, ...openNotifications.value.map(({ id }) => id));
  if (newest > before && before > 0 && sound.peek()) beep();
  before = Math.max(before, newest);
});

function beep(): void {
  const audio = new AudioContext();
  const tone = audio.createOscillator();
  const loudness = audio.createGain();
  loudness.gain.setValueAtTime(0.15, audio.currentTime);
  loudness.gain.exponentialRampToValueAtTime(0.001, audio.currentTime + SECONDS);
  tone.frequency.value = 880;
  tone.connect(loudness).connect(audio.destination);
  tone.onended = () => void audio.close();
  tone.start();
  tone.stop(audio.currentTime + SECONDS);
}
