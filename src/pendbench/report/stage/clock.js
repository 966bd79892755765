// The time that every view shows. Frames are drawn only while something changes.
class Clock {
  constructor(duration) {
    this.duration = duration;
    this.time = 0;
    this.speed = 1;
    this.playing = false;
    this.views = [];
    this.waiting = false;
    this.before = 0;
  }

  set(time) {
    this.time = Math.min(Math.max(time, 0), this.duration);
    this.wake();
  }

  step(seconds) {
    this.pause();
    this.set(this.time + seconds);
  }

  play() {
    if (this.time >= this.duration) this.time = 0;
    this.playing = true;
    this.before = performance.now();
    this.wake();
  }

  pause() {
    this.playing = false;
    this.wake();
  }

  wake() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame((now) => this.frame(now));
  }

  frame(now) {
    this.waiting = false;
    if (this.playing) this.advance(now);
    for (const view of this.views) view.draw(this.time);
    if (this.playing) this.wake();
  }

  advance(now) {
    // A tab that slept goes on where it was.
    const passed = Math.min(Math.max(now - this.before, 0), 250) / 1000;
    this.before = now;
    this.time = Math.min(this.time + passed * this.speed, this.duration);
    if (this.time >= this.duration) this.playing = false;
  }
}
