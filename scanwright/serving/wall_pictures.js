// Pictures on walls (nodes below /room): seen from inside only, drawn before all that is in the room, without viser's plate
// over the wall under the pointer. The drawing library shows a new picture only after `needsUpdate`.
(() => {
  const update = () => {
    requestAnimationFrame(update);
    const view = window.__viserMutable;
    for (const [name, node] of Object.entries(view?.nodeRefFromName ?? {}))
      if (name.startsWith("/room/"))
        node?.traverse((child) => {
          const { material } = child;
          if (!material) return;
          material.visible = Boolean(material.map);
          if (!material.visible || (material.version && material.side === 0)) return;
          Object.assign(material, { side: 0, depthWrite: false, needsUpdate: true });
          child.renderOrder = -1;
          view.requestRender();
        });
  };
  requestAnimationFrame(update);
})();
