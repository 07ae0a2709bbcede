//! What is served under which path.
//!
//! | path | answer |
//! |---|---|
//! | `/`, `/page.css`, `/page.js`, `/draw.js`, `/icon.svg` | the page |
//! | `/events` | server-sent: `hello` once, then ten `frame`s a second |
//! | `/metrics` | OpenMetrics text |
//! | `POST /command` | `{"verb": "stop"}`, or `{"verb": "set-target", "angles_deg": [[70], [110]]}` |

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use futures_util::stream::{self, Stream};
use magsteer::live::Unsent;
use magsteer_hal::operator::{cause, state, verb};
use serde::{Deserialize, Serialize};
use tokio::sync::broadcast;
use tokio::sync::broadcast::error::RecvError;

use super::desk::{Answer, Ask, Desk};
use super::guard::{Guard, Refusal};

const PAGE: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/page.css");
const SCRIPT: &str = include_str!("page/page.js");
const DRAWING: &str = include_str!("page/draw.js");
const ICON: &str = include_str!("page/icon.svg");
/// Where the page's markup takes the name of this life of the process.
const BOOT_PLACE: &str = "{{boot}}";
/// Longest command: eight magnets with two angles each need some three hundred bytes.
const COMMAND_BYTES_MAX: usize = 4 << 10;
/// A silent connection is told that it lives.
const KEEP_ALIVE: Duration = Duration::from_secs(5);

/// Nothing but what this server serves, no scripts or styles within the page, no frames, no forms.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self'; \
    base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

#[derive(Debug)]
struct Shared {
    desk: Desk,
    guard: Guard,
}

/// Everything that is served.
pub fn router(desk: Desk, guard: Guard) -> Router {
    let shared = Arc::new(Shared { desk, guard });
    Router::new()
        .route("/", get(page))
        .route("/page.css", get(|| asset("text/css", STYLE)))
        .route("/page.js", get(|| asset("text/javascript", SCRIPT)))
        .route("/draw.js", get(|| asset("text/javascript", DRAWING)))
        .route("/icon.svg", get(|| asset("image/svg+xml", ICON)))
        .route("/events", get(events))
        .route("/metrics", get(metrics))
        .route("/command", post(command))
        .layer(DefaultBodyLimit::max(COMMAND_BYTES_MAX))
        .layer(middleware::from_fn_with_state(Arc::clone(&shared), guarded))
        .with_state(shared)
}

/// Asks the guard before, and adds what every answer carries.
async fn guarded(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let mut response = match shared.guard.view(request.headers()) {
        Ok(()) => next.run(request).await,
        Err(refusal) => refused(refusal),
    };
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::X_FRAME_OPTIONS, "DENY"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
        (header::HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

fn refused(refusal: Refusal) -> Response {
    (StatusCode::FORBIDDEN, json(&Refused { error: refusal.to_string() })).into_response()
}

async fn page(State(shared): State<Arc<Shared>>) -> impl IntoResponse {
    let guard = &shared.guard;
    let text = PAGE.replace(BOOT_PLACE, guard.boot());
    ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], text)
}

async fn asset(kind: &'static str, text: &'static str) -> impl IntoResponse {
    ([(header::CONTENT_TYPE, format!("{kind}; charset=utf-8"))], text)
}

async fn metrics(State(shared): State<Arc<Shared>>) -> Response {
    match shared.desk.ask(Ask::Metrics).await {
        Some(text) => {
            let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
            ([(header::CONTENT_TYPE, kind)], text).into_response()
        }
        None => StatusCode::SERVICE_UNAVAILABLE.into_response(),
    }
}

async fn events(State(shared): State<Arc<Shared>>) -> Sse<impl Stream<Item = Result<Event, Infallible>>> {
    // Listened to first: what is drawn between the two comes twice rather than never.
    let start = (shared.desk.clone(), shared.desk.listen(), true);
    let stream = stream::unfold(start, |(desk, mut frames, greet)| async move {
        let event = if greet { hello(&desk).await } else { next(&desk, &mut frames).await };
        event.map(|event| (Ok(event), (desk, frames, false)))
    });
    Sse::new(stream).keep_alive(KeepAlive::new().interval(KEEP_ALIVE))
}

async fn hello(desk: &Desk) -> Option<Event> {
    desk.ask(Ask::Hello).await.map(|text| Event::default().event("hello").data(text))
}

/// The next frame; for a listener that did not keep up, a new begin.
async fn next(desk: &Desk, frames: &mut broadcast::Receiver<Arc<str>>) -> Option<Event> {
    match frames.recv().await {
        Ok(frame) => Some(Event::default().event("frame").data(frame)),
        Err(RecvError::Lagged(_)) => hello(desk).await,
        Err(RecvError::Closed) => None,
    }
}

/// What a page asks for.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Command {
    verb: String,
    #[serde(default)]
    angles_deg: Vec<Vec<f64>>,
}

#[derive(Serialize)]
struct Answered {
    accepted: bool,
    /// After the request.
    state: &'static str,
    /// Why it was refused; empty when it was done.
    cause: &'static str,
}

#[derive(Serialize)]
struct Refused {
    error: String,
}

async fn command(State(shared): State<Arc<Shared>>, headers: HeaderMap, body: Bytes) -> Response {
    if let Err(refusal) = shared.guard.command(&headers) {
        return refused(refusal);
    }
    let command: Command = match serde_json::from_slice(&body) {
        Ok(command) => command,
        Err(error) => {
            let error = format!("not a command: {error}");
            return (StatusCode::BAD_REQUEST, json(&Refused { error })).into_response();
        }
    };
    let answer = if command.verb == verb::name(verb::SET_TARGET) {
        shared.desk.ask(|sender| Ask::Target(command.angles_deg, sender)).await
    } else {
        let verbs = [verb::ARM, verb::GO, verb::HOLD, verb::RETREAT, verb::STOP, verb::RESET, verb::ESTOP];
        let Some(verb) = verbs.into_iter().find(|verb| verb::name(*verb) == command.verb) else {
            let error = format!("{:?} is no command", command.verb);
            return (StatusCode::BAD_REQUEST, json(&Refused { error })).into_response();
        };
        shared.desk.ask(|sender| Ask::Verb(verb, sender)).await
    };
    answered(answer)
}

fn answered(answer: Option<Answer>) -> Response {
    match answer {
        Some(Ok(answer)) => {
            let accepted = answer.accepted == 1;
            let cause = if accepted { "" } else { cause::text(answer.cause) };
            json(&Answered { accepted, state: state::name(answer.state), cause })
        }
        Some(Err(error @ Unsent::Target { .. })) => {
            (StatusCode::BAD_REQUEST, json(&Refused { error: error.to_string() })).into_response()
        }
        Some(Err(error)) => {
            (StatusCode::SERVICE_UNAVAILABLE, json(&Refused { error: error.to_string() })).into_response()
        }
        None => StatusCode::SERVICE_UNAVAILABLE.into_response(),
    }
}

/// Plain data has no reason to fail.
fn json(value: &impl Serialize) -> Response {
    let text = serde_json::to_string(value).unwrap_or_else(|_| "{}".to_owned());
    ([(header::CONTENT_TYPE, "application/json")], text).into_response()
}
