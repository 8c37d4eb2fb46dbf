import { render } from "preact";
import { App } from "./app";
import { AppState } from "./app_state";
import "./style.css";

const host = document.getElementById("app")!;
host.replaceChildren();
render(<App state={new AppState()} />, host);
