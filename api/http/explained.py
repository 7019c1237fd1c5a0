"""A page for each kind of problem: what happened and what to do, for whoever reads its `type`."""

from collections.abc import Mapping
from html import escape

# What a code means, and the next step. Every code that the service answers with stands here.
EXPLAINED: Mapping[str, tuple[str, str]] = {
    "access": ("Tokens, accounts or the audit log cannot be read or written.", "Look at the folder that is named."),
    "bad-trial": ("A trial stayed bad however often it was made.", "What was recorded is kept; see why it is bad."),
    "busy": ("Something else uses the bench or the session.", "Wait for the job that is named, or cancel it."),
    "cancelled": ("It was ended by a person.", "What it had written stays; start it again if it is wanted."),
    "catalogue": ("The catalogue cannot be read.", "The message says how to rebuild it; sessions stay as they are."),
    "cause-not-cleared": ("What stopped the bench is still there.", "Clear the cause, then acknowledge again."),
    "check-failed": ("A check ran, and its answer is no.", "The message says what is wrong; mend that."),
    "content-length": ("The stated size of the body is no number.", "Let the HTTP library state it."),
    "crashed": ("The process of a computation ended.", "Its last words are in the message; start it again."),
    "data": ("The data cannot be used.", "The message names file, place and bound."),
    "device": ("A device is absent, silent or in fault.", "Run the doctor; look at power and cable."),
    "disconnected": ("No loop runs, so nothing can move.", "The message says why; mend that, then connect again."),
    "disk-full": ("There is no room for this beside what recordings need.", "Free space on the disk that is named."),
    "error": ("The program met an error of its own.", "Report it, with what the service has printed."),
    "failed": ("The service could not do it.", "The message says why; report it where that does not help."),
    "gone": ("What was asked for was removed meanwhile.", "Look at the list again."),
    "host": ("The request was sent to a name that is not this service's.", "Use the address that `rig serve` prints."),
    "http": ("The request is not one that HTTP knows here.", "Compare it with /api/v1/openapi.json."),
    "idempotency-key": ("What moves must not move twice.", "Send a header Idempotency-Key, new for each thing."),
    "idempotency-key-reused": ("The key was sent with another body before.", "Give each new request a new key."),
    "if-match": ("A change must say what it changes.", "Send the ETag of the last look as If-Match."),
    "in-progress": ("The same request is still being answered.", "Wait, then send it again with the same key."),
    "interrupted": ("The service ended while it was under way.", "See what it left, then start it again."),
    "invalid-request": ("The body or the query is not as described.", "The message names the field and its bound."),
    "job-state": ("The job cannot do that in its state.", "Its `can` says what it may be asked for."),
    "lease-held": ("Somebody else is in control.", "Ask them, wait for the end of their lease, or take over."),
    "lease-moving": ("Somebody else moves the bench.", "Wait, or stop it; scope admin may take over meanwhile."),
    "link": ("A session holds a link, which could lead anywhere.", "Copy what it leads to into the session."),
    "method": ("This address does not take that method.", "The header Allow names those it takes."),
    "multipart": ("The files did not come as multipart/form-data.", "Send each as a part with a filename."),
    "no-credential": ("Nobody is logged in.", "Log in on the page, or send a token of `rig token create`."),
    "no-files": ("The upload held no file.", "Send each file as a part named file."),
    "no-lease": ("Whoever moves the bench needs control of it.", "POST /api/v1/control/lease, and send its lease_id."),
    "no-rate": ("A decimation needs a rate.", "Give max_rate_hz with the subscription."),
    "no-recording": ("The folder holds nothing that can be read as a session.", "Look at it with `rig verify`."),
    "no-right": ("A route without a declared right serves nobody.", "Report this."),
    "no-such-file": ("The job has no such file.", "Its `files` lists those it has; they are kept for a week."),
    "no-such-job": ("There is no job of that id.", "GET /api/v1/jobs lists the newest five hundred."),
    "no-such-model": ("The session has no fitted model.", "Fit it first; the extended one comes of a diagnosis."),
    "no-such-problem": ("There is no page of that name.", "The message of the problem itself says it."),
    "no-such-protocol": ("There is no protocol of that name.", "GET /api/v1/protocols lists them."),
    "no-such-recording": ("The session has no such file.", "GET /api/v1/sessions/{session} lists its files."),
    "no-such-route": ("There is nothing at this address.", "GET /api/v1/openapi.json lists all."),
    "no-such-session": ("There is no session of that name.", "GET /api/v1/sessions lists them."),
    "no-such-stream": ("There is no stream of that name.", "GET /api/v1/streams lists them."),
    "no-such-subject": ("Nothing is known of that code.", "GET /api/v1/subjects lists codes."),
    "no-such-upload": ("There is no upload of that id.", "Uploads are kept for a week; send the files again."),
    "not-confirmed": ("The loop did not confirm the stop in time.", "Use the hardware emergency stop."),
    "not-recovered": ("Recovery did not succeed.", "The message says what is missing; mend it and recover again."),
    "origin": ("A page of another site may not act on this bench.", "Use the page of the service itself."),
    "outcome-unknown": ("The service ended or failed meanwhile.", "Look whether it took effect, then use a new key."),
    "password": ("Name or password is wrong.", "Accounts are made on the bench's computer: `rig account set NAME`."),
    "queue-full": ("Too many computations wait.", "Cancel one, or wait."),
    "range": ("The file has no such part.", "Content-Range says its bytes; write Range as bytes=FIRST-LAST."),
    "rate": ("The rate is outside what can be sent.", "Ask for a rate within the bounds that are named."),
    "refused": ("A check refuses it.", "The message names what was asked, the limit and the next step."),
    "safety-stop": ("Motion was stopped.", "Look why, acknowledge it, then start again."),
    "scope": ("The credential does not allow this.", "Use a token or an account of the scope that is named."),
    "session-exists": ("Recordings are never overwritten.", "Give another name."),
    "slow-body": ("The body did not come in time.", "Send it whole; look at the line."),
    "stale": ("It was changed meanwhile.", "Look at it again, then change it."),
    "stopped": ("A stop is in force.", "Look why, acknowledge it (POST /api/v1/estop/reset), then start."),
    "storage": ("A file cannot be read or written.", "The message names it and why; see to that."),
    "subprotocol": ("The stream speaks rig.v1.", "Ask for the subprotocol rig.v1."),
    "ticket": ("The link was used, or is older than five minutes.", "`rig token link` prints another."),
    "too-large": ("The body is larger than this address reads.", "Send less, or in parts."),
    "too-many": ("Too many requests, or tries to log in.", "Wait as long as Retry-After says."),
    "too-many-channels": ("One client has too many channels.", "Unsubscribe from some."),
    "too-many-open": ("As many connections look on as may.", "Close one, or come back later."),
    "too-many-views": ("Clients ask for too many different rates at once.", "Ask for a rate that others use."),
}  # fmt: skip


def page(code: str) -> str:
    """The page of ``code``."""
    meaning, step = EXPLAINED[code]
    return (
        "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content='width=device-width'>"
        f"<title>{escape(code)}</title><h1>{escape(code)}</h1><p>{escape(meaning)}</p><p>{escape(step)}</p></html>"
    )
