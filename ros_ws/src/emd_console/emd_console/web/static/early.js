// The live socket and the camera's picture. This script stands in the page itself, so that the
// picture is seen before the framework has built the rest; then it moves to its place there.

class Picture {
  constructor() {
    this.canvas = document.getElementById("picture");
    this.note = document.getElementById("picture-note");
    this.shown = 0;
    this.onSize = () => {};
  }

  async show(blob) {
    const image = await createImageBitmap(blob);
    const { width, height } = image;
    if (this.canvas.width !== width || this.canvas.height !== height) {
      [this.canvas.width, this.canvas.height] = [width, height];
      this.onSize(width, height);
    }
    this.canvas.getContext("2d").drawImage(image, 0, 0);
    image.close();
    if (!this.shown) performance.mark("first picture");
    this.shown += 1;
    this.note.hidden = true;
  }

  moveTo(place) {
    place.append(this.canvas, this.note);
    document.getElementById("early").remove();
  }
}

// Pictures are shown at once; sections and poses wait for the page that `attach` is given.
class Live {
  static PICTURE = 1;
  static POSES = 2;

  constructor() {
    this.picture = new Picture();
    this.built = new Promise((resolve) => (this.attach = resolve));
    this.connect();
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}/live`);
    this.socket.binaryType = "blob";
    this.socket.onmessage = (event) => this.take(event.data);
    this.socket.onclose = async () => {
      (await this.built).lost();
      setTimeout(() => this.connect(), 1000);
    };
  }

  async take(data) {
    if (typeof data === "string") {
      const page = await this.built;
      for (const [name, value] of Object.entries(JSON.parse(data))) page.take(name, value);
      return;
    }
    const kind = new Uint8Array(await data.slice(0, 1).arrayBuffer())[0];
    if (kind === Live.POSES) {
      const values = new Float32Array(await data.slice(1).arrayBuffer());
      (await this.built).robot.pose(values);
    } else if (kind === Live.PICTURE) {
      await this.picture.show(data.slice(1, data.size, "image/jpeg"));
      if (this.socket.readyState === WebSocket.OPEN) this.socket.send("next");
      (await this.built).robot.begin();
    }
  }
}

window.live = new Live();
