/* The link of one master and one slave: liveness, age, end of a session and fade, over a hostile channel, with
 * processes that stop and go on. docs/protocol-model.md says what it shows and what it does not.
 *
 * One step is one heartbeat interval. In each step both ends run their timers and send, the channel delivers, and both
 * ends run their timers and their tick. 0 is the master and its direction to the slave, 1 the slave and its direction.
 *
 * PROTOCOL  0: as of commit 3a86b41. 1: loop age, encoding bit, expiry of a session, guardian
 * LIMIT     silence [steps]; EXPIRE: further steps until a session is over
 * SLOTS     datagrams of a session that the channel can hold back in each direction, each for as long as it likes
 * STOPS     1: processes may stop and go on
 * TICKS     1: the ticks of an end may stop and go on while its event loop still sends
 * WRAP      time stamps wrap after so many steps; ECHO_WRAP: the echo byte does. 0: never
 * ERROR     by how much an end may take a datagram for too young: half the asymmetry of the path [steps]
 * CHECK     which property is watched: 1 age of what is taken, 2 age of what drives, 3 one end alone, 4 recovery, 5 fade,
 *           6 nothing twice; 0 all of these. 7: state ENGAGED on one side alone, which no bound is claimed for
 * MUTANT    a fault put into protocol 1, by number
 */
#ifndef PROTOCOL
#define PROTOCOL 1
#endif
#ifndef MUTANT
#define MUTANT 0
#endif
#ifndef LIMIT
#define LIMIT 3
#endif
#ifndef EXPIRE
#define EXPIRE 2
#endif
#ifndef SLOTS
#define SLOTS 1
#endif
#ifndef REPLAYS
#define REPLAYS 0
#endif
#ifndef STOPS
#define STOPS 0
#endif
#ifndef TICKS
#define TICKS 0
#endif
#ifndef WRAP
#define WRAP 0
#endif
#ifndef ECHO_WRAP
#define ECHO_WRAP 0
#endif
#ifndef ERROR
#define ERROR 1
#endif
#ifndef CHECK
#define CHECK 0
#endif
#define WATCHES(property) (CHECK == 0 || CHECK == property)
#ifndef ALONE                        /* longest time for which one end drives while the other is not engaged [steps] */
#define ALONE (LIMIT + 1)
#endif
#ifndef GOOD                         /* steps of a whole channel after which both ends drive again */
#define GOOD 5
#endif
#ifndef GUARD                        /* steps after which the guardian zeroes the device of a stopped process */
#define GUARD 1
#endif
#define FULL 2                       /* the whole force, in steps of the ramp */

#define OVER (LIMIT + EXPIRE + 1)    /* loop age of a session that is over; no age of an end is counted further */
#define OLDEST (WRAP + LIMIT + ERROR + 1)       /* age of a held datagram: older ones are all alike */
#if ECHO_WRAP
#define OLDEST_ECHO (WRAP + 2 * LIMIT + ERROR + 2)
#define TOLD(age) (age == DEAF -> DEAF : age % ECHO_WRAP)
#else
#define OLDEST_ECHO (LIMIT + 1)
#define TOLD(age) age
#endif
#define TOO_OLD 255
#define DEAF 255
#define NEVER 255
#define MASTER 0
#define SLAVE 1

mtype = { CLOSED, SILENT, ENGAGED, LISTENING, CONNECTING, IDLE, EMPTY, HELLO, WELCOME, SEALED };

/* Sessions by the master's view: the one it is in, the one it calls for, and any other that ever was. */
#define NONE 0
#define CURRENT 1
#define NEXT 2
#define FORMER 3

typedef End {
    mtype state;
    byte session;                    /* NONE, CURRENT or FORMER */
    byte loop;                       /* time since the newest own datagram left that the peer is known to have heard */
    byte heard;                      /* time since the newest accepted datagram of the peer left: its true age */
    byte command;                    /* the same of the newest one that was sent while its sender encoded */
    byte quiet;                      /* time since anything fresh came */
    bool peer_encoding;              /* what the newest accepted datagram says */
    byte gain;                       /* share of the force, or of the way to the commanded position, at the device */
    bool frozen;                     /* the ticks of the owner have stopped, while its event loop goes on */
    byte stopped;                    /* 0: the process runs; else since how many steps not */
    byte alone;
}

typedef Datagram {
    mtype kind;
    byte session;
    byte age;                        /* time since it left */
    byte echo;                       /* time since the datagram of the receiver left that it confirms; or DEAF */
    bool encoding;                   /* what it says */
    bool ran;                        /* what is so: its sender was engaged and its ticks, with the encoder, ran */
    bool seen;                       /* its number is marked in the replay window, or its stamp not above the newest */
    byte passed;                     /* 1 + time since a higher number was accepted; 0: none was */
}

#define PLACES (SLOTS + 1)           /* the last place of a direction is for handshake datagrams */
End end[2];
Datagram held[2 * PLACES];
byte pending;                        /* slave: the session on paper, until its first sealed datagram has come */
byte paper;                          /* and the time since the HELLO that it is for came */
byte answer;                         /* slave: 1 + age of the HELLO to be answered; 0: none */
byte good;

/* Chosen or used within a step, 0 between steps, so that they add no states. */
byte fate[2];                        /* of what is sent: 0 arrives, 1 is lost, 2 is held, 3 arrives and is held too */
byte release[2];                     /* 1 + place of the held datagram that arrives; 0: none */
byte where[2], woken[2];
byte who, k, kind, place, seem, echo;
Datagram d;

#if PROTOCOL == 0
#define IS_DRIVING(e) (end[e].state == ENGAGED && end[e].command != NEVER)
#define AGE(e) end[e].quiet
#else
#if MUTANT == 2                      /* the loops look at the state alone */
#define IS_DRIVING(e) (end[e].state == ENGAGED && end[e].command != NEVER)
#else
#define IS_DRIVING(e) (end[e].state == ENGAGED && end[e].peer_encoding)
#endif
#if MUTANT == 10                     /* engaged while the other is heard */
#define AGE(e) end[e].quiet
#else
#define AGE(e) end[e].loop
#endif
#endif
#define RUNS_ENCODER(e) (end[e].state == ENGAGED && !end[e].frozen)
#if PROTOCOL == 0 || MUTANT == 1     /* the event loop says it without being told by the owner's tick */
#define IS_ENCODING(e) (end[e].state == ENGAGED)
#else
#define IS_ENCODING(e) RUNS_ENCODER(e)
#endif
#define IS_THERE(e) (end[e].state == ENGAGED && end[e].stopped == 0 && !end[e].frozen)
#define IS_UP(e) (end[e].stopped == 0 && !end[e].frozen)
#define IS_CALLING (end[MASTER].state == CONNECTING || end[MASTER].state == SILENT)

inline count(what, most) { what = (what < most -> what + 1 : what) }

inline forget(place) {
    held[place].kind = 0; held[place].session = 0; held[place].age = 0; held[place].echo = 0;
    held[place].encoding = 0; held[place].ran = 0; held[place].seen = 0; held[place].passed = 0
}

inline keep(place) {
    held[place].kind = d.kind; held[place].session = d.session; held[place].age = d.age; held[place].echo = d.echo;
    held[place].encoding = d.encoding; held[place].ran = d.ran; held[place].seen = d.seen; held[place].passed = 0
}

inline rename(from, to) {
    for (k : 0 .. 2 * PLACES - 1) {
        if :: held[k].kind != 0 && held[k].session == from -> held[k].session = to :: else fi
    }
    k = 0;
    if :: end[SLAVE].session == from -> end[SLAVE].session = to :: else fi;
    if :: pending == from -> pending = to :: else fi
}

/* --- one end */

inline end_session(e) {
    end[e].session = NONE; end[e].peer_encoding = 0;
    end[e].loop = OVER; end[e].heard = OVER; end[e].command = NEVER; end[e].quiet = OVER
}

inline run_timers(e) {
#if PROTOCOL == 1 && MUTANT != 9     /* mutant 9: a session on paper is kept for ever */
    if :: e == SLAVE && paper >= OVER -> pending = NONE; paper = 0; answer = 0 :: else fi;
#endif
    if
    :: end[e].session == NONE
    :: else ->
        if
#if PROTOCOL == 1 && MUTANT != 3     /* mutant 3: a session never ends by silence */
        :: end[e].loop >= OVER ->
            end_session(e);
            if
            :: e == MASTER -> rename(CURRENT, FORMER); rename(NEXT, FORMER); end[e].state = CONNECTING
            :: else -> end[e].state = LISTENING
            fi
        :: end[e].loop < OVER && AGE(e) > LIMIT ->
#else
        :: AGE(e) > LIMIT ->
#endif
            if :: e == MASTER && end[e].state == ENGAGED -> rename(NEXT, FORMER) :: else fi;     /* a new call */
            end[e].state = SILENT
        :: AGE(e) <= LIMIT ->
            if :: e == MASTER && end[e].state == SILENT -> rename(NEXT, FORMER) :: else fi;      /* hangs up */
            end[e].state = ENGAGED
        fi
    fi
}

inline tick(e) {
    if
    :: IS_DRIVING(e) && AGE(e) < LIMIT ->
        end[e].gain = (end[e].gain < FULL -> end[e].gain + 1 : FULL);
        end[e].gain = (end[e].gain > LIMIT - AGE(e) -> LIMIT - AGE(e) : end[e].gain)
    :: else -> end[e].gain = 0
    fi
}

inline begin_session(e, named) {
    end[e].session = named; end[e].state = ENGAGED; end[e].peer_encoding = 0; end[e].quiet = 0;
    end[e].loop = OVER; end[e].heard = OVER; end[e].command = NEVER;
    end[e].gain = 0
}

/* Held datagrams of the session with a lower number have been overtaken. */
inline overtake(e) {
    for (k : (1 - (e)) * PLACES .. (1 - (e)) * PLACES + SLOTS - 1) {
        if
        :: held[k].kind == SEALED && held[k].session == d.session && held[k].age > d.age && held[k].passed == 0 ->
            held[k].passed = 1
        :: else
        fi
    }
    k = 0
}

/* A sealed datagram of this end's session. */
inline accept(e) {
    seem = (WRAP > 0 && d.age >= WRAP -> d.age - WRAP : d.age);              /* its age as its stamp tells it */
    echo = TOLD(d.echo);
    if
    :: d.seen && MUTANT != 4 -> seem = TOO_OLD                               /* REPLAYED; mutant 4: no window */
    :: else
    fi;
#if PROTOCOL == 1
    if
    :: d.passed > LIMIT + 1 && MUTANT != 5 -> seem = TOO_OLD                 /* STALE by its number; mutant 5: not asked */
    :: d.encoding && echo > LIMIT && MUTANT != 6 -> seem = TOO_OLD           /* STALE by its loop; mutant 6: not asked */
    :: else
    fi;
#endif
    if
    :: seem > LIMIT + ERROR                                                  /* STALE by its own age */
    :: else ->
        overtake(e);
        assert(!WATCHES(6) || !d.seen);
        assert(!WATCHES(1) || !d.encoding || d.age <= LIMIT);
        end[e].quiet = 0;
#if PROTOCOL == 1
        if :: d.echo != DEAF && echo < end[e].loop -> end[e].loop = echo :: else fi;
#endif
        if :: d.ran && d.age < end[e].command -> end[e].command = d.age :: else fi;
        if
        :: d.age < end[e].heard || MUTANT == 7 ->                            /* mutant 7: by arrival, not by number */
            end[e].heard = d.age; end[e].peer_encoding = d.encoding
        :: else
        fi
    fi;
    seem = 0; echo = 0
}

inline receive(e) {
    if
    :: d.kind == SEALED && d.session == end[e].session -> accept(e)
    :: d.kind == SEALED && d.session != end[e].session && e == SLAVE && d.session == pending ->
        begin_session(SLAVE, pending);
        pending = NONE; paper = 0; answer = 0;
        accept(SLAVE)
    :: d.kind == HELLO && !d.seen && d.session == NEXT ->                    /* nobody can use the answer to any other */
        pending = NEXT; paper = 0; answer = 1 + d.age;
#if PROTOCOL == 1                    /* of a held HELLO the stamp is not above that of this one */
        if :: held[SLOTS].kind == HELLO && held[SLOTS].age >= d.age -> held[SLOTS].seen = 1 :: else fi
#endif
    :: d.kind == WELCOME && d.session == NEXT && IS_CALLING ->
        rename(CURRENT, FORMER); rename(NEXT, CURRENT);
        begin_session(MASTER, CURRENT);
        end[MASTER].loop = d.echo; end[MASTER].heard = d.age
    :: else
    fi
}

/* --- the channel */

inline set(sort, named, with_echo, encodes) {
    d.kind = sort; d.session = named; d.age = 0; d.echo = with_echo; d.encoding = encodes; d.ran = 0; d.seen = 0; d.passed = 0
}

inline unset() { d.kind = 0; d.session = 0; d.age = 0; d.echo = 0; d.encoding = 0; d.ran = 0; d.seen = 0; d.passed = 0 }

/* What one end sends in a step, in this order, and then what the channel has held back. */
inline send_sealed(e) {
    if
    :: end[e].stopped == 0 && end[e].session != NONE ->
        set(SEALED, end[e].session, end[e].heard, IS_ENCODING(e));
        d.ran = RUNS_ENCODER(e);
        if :: end[e].quiet > LIMIT -> d.echo = DEAF :: else fi;
        place = e * PLACES + where[e]
    :: else
    fi
}

inline send_handshake(e) {
    if
    :: e == MASTER && end[e].stopped == 0 && IS_CALLING ->
        set(HELLO, NEXT, DEAF, 0); place = e * PLACES + SLOTS
    :: e == SLAVE && end[e].stopped == 0 && answer != 0 && pending == NEXT ->
        set(WELCOME, NEXT, answer - 1, 0); place = e * PLACES + SLOTS;
        answer = 0
    :: else
    fi
}

inline take_held(from) {
    if
    :: release[from] != 0 ->
        k = from * PLACES + release[from] - 1;
        d.kind = held[k].kind; d.session = held[k].session; d.age = held[k].age; d.echo = held[k].echo;
        d.encoding = held[k].encoding; d.ran = held[k].ran; d.seen = held[k].seen; d.passed = held[k].passed;
        held[k].seen = (d.kind != WELCOME);
        k = 0
    :: else
    fi
}

/* The channel does with what has been sent as it has chosen; what arrives at a process that is stopped waits there. */
inline pass(from) {
    for (kind : 0 .. 2) {
        if
        :: kind == 0 -> send_sealed(from)
        :: kind == 1 -> send_handshake(from)
        :: kind == 2 -> take_held(from)
        fi;
        if
        :: d.kind != 0 && kind < 2 && (fate[from] >= 2 || (fate[from] == 0 && end[1 - from].stopped != 0)) ->
            keep(place);
            held[place].seen = (fate[from] == 3 && d.kind != WELCOME)
        :: else
        fi;
        if
        :: d.kind != 0 && end[1 - from].stopped == 0 && (kind == 2 || fate[from] == 0 || fate[from] == 3) ->
            receive(1 - from)
        :: else
        fi;
        unset(); place = 0
    }
    kind = 0
}

inline age_end(e) {
    count(end[e].loop, OVER); count(end[e].heard, OVER); count(end[e].command, OVER); count(end[e].quiet, OVER);
    if :: end[e].stopped != 0 -> count(end[e].stopped, LIMIT + 1) :: else fi
}

inline age_held() {
    for (k : 0 .. 2 * PLACES - 1) {
        if
        :: held[k].kind != 0 ->
            count(held[k].age, OLDEST);
            if :: held[k].echo != DEAF -> count(held[k].echo, OLDEST_ECHO) :: else fi;
            if :: held[k].passed != 0 -> count(held[k].passed, LIMIT + 2) :: else fi
        :: else
        fi
    }
    k = 0
}

/* What nobody would take in any case is the same as nothing. */
inline sift() {
    for (k : 0 .. 2 * PLACES - 1) {
        if
        :: held[k].kind == SEALED && (held[k].age >= OLDEST || (held[k].seen && !REPLAYS)
           || (held[k].passed > LIMIT + 1 && PROTOCOL == 1 && MUTANT != 5)
           || (k < PLACES && held[k].session == FORMER && end[SLAVE].session != FORMER && pending != FORMER)
           || (k >= PLACES && held[k].session == FORMER)) -> forget(k)
        :: (held[k].kind == HELLO || held[k].kind == WELCOME) && (held[k].session != NEXT || held[k].seen) -> forget(k)
        :: else
        fi
    }
    k = 0
}

inline watch(e) {
    assert(!WATCHES(2) || !IS_UP(e) || !IS_DRIVING(e) || end[e].command <= LIMIT);
    if
    :: WATCHES(3) && IS_UP(e) && IS_DRIVING(e) && !IS_THERE(1 - e) ->
        end[e].alone++;
        assert(end[e].alone <= ALONE)
    :: CHECK == 7 && IS_THERE(e) && !IS_THERE(1 - e) ->
        end[e].alone++;
        assert(end[e].alone <= ALONE)
    :: else -> end[e].alone = 0
    fi;
    if
    :: WATCHES(5) ->
        assert(end[e].stopped <= LIMIT || end[e].gain == 0);                 /* it does not stand while the process stops */
        assert(woken[e] <= LIMIT || end[e].gain <= 1);                       /* and fades in afterwards */
        assert(!IS_UP(e) || IS_DRIVING(e) || end[e].gain == 0)     /* there is none without the peer */
    :: else
    fi
}

inline watch_channel() {
    if
    :: WATCHES(4) && fate[0] == 0 && fate[1] == 0 && IS_UP(0) && IS_UP(1) -> count(good, GOOD)
    :: else -> good = 0
    fi;
    assert(good < GOOD || (IS_DRIVING(MASTER) && IS_DRIVING(SLAVE) && end[SLAVE].session == CURRENT))
}

inline guard(e) {
    skip;
#if PROTOCOL == 1 && MUTANT != 8                                             /* mutant 8: no guardian */
    if :: end[e].stopped > GUARD -> end[e].gain = 0 :: else fi
#endif
}

/* A line of the trace that `spin -t` shows. */
inline print_end(e) {
    printf("%d %e in %d: loop %d heard %d command %d quiet %d peer encodes %d gain %d stopped %d alone %d | sent %d released %d held %e age %d echo %d in %d passed %d; paper %d\n",
        (e), end[e].state, end[e].session, end[e].loop, end[e].heard, end[e].command, end[e].quiet, end[e].peer_encoding,
        end[e].gain, end[e].stopped, end[e].alone, fate[e], release[e],
        held[e * PLACES].kind, held[e * PLACES].age, held[e * PLACES].echo, held[e * PLACES].session, held[e * PLACES].passed, pending)
}

active proctype world() {
    d_step {
        end[MASTER].state = CONNECTING; end[SLAVE].state = LISTENING;
        for (who : 0 .. 1) { end_session(who) }
        who = 0
    }
    do
    :: atomic {
        /* choose */
        for (k : 0 .. 1) {
#if TICKS
            if
            :: end[k].frozen = 0
            :: end[k].frozen = 1
            fi;
#endif
#if STOPS
            if
            :: end[k].stopped == 0
            :: end[k].stopped == 0 -> end[k].stopped = 1
            :: end[k].stopped != 0
            :: end[k].stopped != 0 -> woken[k] = end[k].stopped; end[k].stopped = 0
            fi;
#endif
            if
            :: fate[k] = 0
            :: fate[k] = 1
            :: fate[k] = 2
            :: REPLAYS -> fate[k] = 3
            fi;
            if
            :: release[k] = 0
            :: held[k * PLACES].kind != 0 && end[1 - k].stopped == 0 -> release[k] = 1
            :: held[k * PLACES + 1].kind != 0 && end[1 - k].stopped == 0 -> release[k] = 2
#if SLOTS > 1
            :: held[k * PLACES + 2].kind != 0 && end[1 - k].stopped == 0 -> release[k] = 3
            fi;
            if
            :: where[k] = 0
            :: fate[k] >= 2 -> where[k] = 1
#endif
            fi
        }
        d_step {
            k = 0;
            age_held();
#if PROTOCOL == 1
            if :: pending != NONE -> count(paper, OVER) :: else fi;
#endif
            for (who : 0 .. 1) {
                age_end(who);
                if :: end[who].stopped == 0 -> run_timers(who) :: else fi
            }
            for (who : 0 .. 1) { pass(who) }
            for (who : 0 .. 1) {
                if
                :: end[who].stopped == 0 ->
                    run_timers(who);
                    if :: !end[who].frozen -> tick(who) :: else fi
                :: else
                fi
            }
            for (who : 0 .. 1) { guard(who); print_end(who); watch(who) }
            watch_channel();
            who = 0;
            sift();
            fate[0] = 0; fate[1] = 0; release[0] = 0; release[1] = 0; where[0] = 0; where[1] = 0; woken[0] = 0; woken[1] = 0
        }
       }
    od
}
