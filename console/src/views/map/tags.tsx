// The tags as a list: what the map shows, in words, and the way to it by keyboard.
import { useRef } from "preact/hooks";
import { texts } from "../../model/page";
import { picked, picking } from "../../model/mission/picking";
import { placeOf, twin, type Tag } from "../../model/robot/twin";
import { Panel } from "../../parts/panel";
import { selected, twinSilentSince } from "./scene";
import { bringIn, choose } from "./surface";
import { tagKey, tellTag } from "./things";

/** Ids are numbers as a rule: 2 comes before 10. */
const byId = new Intl.Collator("en", { numeric: true });

function steps(key: string, from: number, count: number): number | undefined {
  if (key === "ArrowDown" || key === "ArrowRight") return Math.min(count - 1, from + 1);
  if (key === "ArrowUp" || key === "ArrowLeft") return Math.max(0, from - 1);
  if (key === "Home") return 0;
  return key === "End" ? count - 1 : undefined;
}

function Line({ tag, isFirst }: { tag: Tag; isFirst: boolean }) {
  const { title, lines } = tellTag(tag);
  const key = tagKey(tag.tag_id);
  const isChosen = selected.value === key;
  const isPicked = picking.value && picked.value.includes(tag.tag_id);
  return (
    <li>
      <button
        data-tag={tag.tag_id}
        aria-pressed={picking.value ? !!isPicked : isChosen}
        tabIndex={isChosen || (isFirst && !selected.value.startsWith("tag:")) ? 0 : -1}
        onClick={() => choose(key)}
      >
        <b>
          {isPicked && "✓ "}
          {title}
        </b>{" "}
        {lines.join(" · ")}
        {!placeOf(tag) && ` · ${texts.value.map.noPlace}`}
      </button>
    </li>
  );
}

export function TagList() {
  const t = texts.value.map;
  const list = useRef<HTMLUListElement>(null);
  const tags = [...(twin.shown.value?.value ?? [])].sort((one, other) => byId.compare(one.tag_id, other.tag_id));
  const go = (event: KeyboardEvent): void => {
    const at = tags.findIndex(({ tag_id }) => tagKey(tag_id) === selected.value);
    const to = steps(event.key, at, tags.length);
    const tag = to === undefined ? undefined : tags[to];
    if (!tag) return;
    event.preventDefault();
    selected.value = tagKey(tag.tag_id);
    const place = placeOf(tag);
    if (place) bringIn(place);
    list.current?.querySelectorAll("button")[to!]?.focus();
  };
  return (
    <Panel title={t.list(tags.length)}>
      <ul ref={list} class={`map-tags ${twinSilentSince.value ? "stale" : ""}`} onKeyDown={go}>
        {tags.map((tag, index) => (
          <Line key={tag.tag_id} tag={tag} isFirst={index === 0} />
        ))}
      </ul>
      {tags.length === 0 && <p class="soft">{t.noTags}</p>}
    </Panel>
  );
}

