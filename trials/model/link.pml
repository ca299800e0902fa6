/* The link of one master and one slave: liveness, age, the agreed round trip, end of a session and fade, over a hostile
 * channel, with processes that stop and go on. README.md says what it shows and what it does not.
 *
 * One step is one heartbeat interval. In each step both ends run their timers and send, the channel delivers, and both
 * ends run their timers and their tick. 0 is the master and its direction to the slave, 1 the slave and its direction.
 * At any step the channel may become whole: from then on each datagram arrives after the delay of its direction.
 *
 * PROTOCOL  0: as of commit 3a86b41. 1: the present one
 * LIMIT     silence [steps]; LONGEST: largest round trip R that may be agreed; EXPIRE: steps of silence until a session is
 *           over, 0: never
 * CHANGES   1: R changes in a session
 * SESSIONS  1: there is no second session until the channel is whole. 0: any number
 * SLOTS     datagrams of a session that the channel can hold back in each direction, as many as DELAY at least; the hostile
 *           one holds HOLDS of them, each for as long as it likes
 * REPLAYS   1: the hostile channel delivers repeatedly
 * STOPS     1: processes may stop and go on
 * TICKS     1: the ticks of an end may stop and go on while its event loop still sends
 * WRAP      time stamps wrap after so many steps. 0: never
 * ERROR     by how much an end may take a datagram for too young, beyond half of R [steps]
 * HOSTILE   1: the channel loses, holds and reorders until it becomes whole. 0: it is whole from the beginning, and its
 *           delays change PACE steps after the last change or later
 * DELAY     longest delay of each direction of the whole channel; GOOD: its steps after which both ends drive again
 * CHECK     which property is watched: 1 age of what is taken, 2 age of what drives, 3 one end alone, 4 recovery, 5 fade,
 *           6 nothing twice, 8 a cut, 9 echoes; 0 all of these. 10: all but 4 and 5. 7: state ENGAGED on one side alone,
 *           which no bound is claimed for
 * MUTANT    a fault put into the present protocol, by number
 */
#ifndef PROTOCOL
#define PROTOCOL 1
#endif
#ifndef MUTANT
#define MUTANT 0
#endif
#ifndef LIMIT
#define LIMIT 2
#endif
#ifndef LONGEST
#define LONGEST 2
#endif
#ifndef EXPIRE
#define EXPIRE 1
#endif
#ifndef CHANGES
#define CHANGES 0
#endif
#ifndef SESSIONS
#define SESSIONS 0
#endif
#ifndef SLOTS
#define SLOTS 1
#endif
#ifndef HOLDS
#define HOLDS SLOTS
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
#ifndef ERROR
#define ERROR 0
#endif
#ifndef DELAY
#define DELAY 0
#endif
#ifndef PACE
#define PACE GOOD
#endif
#ifndef HOSTILE
#define HOSTILE 1
#endif
#ifndef CHECK
#define CHECK 0
#endif
#define WATCHES(property) (CHECK == 0 || CHECK == property || (CHECK == 10 && property != 4 && property != 5))
#ifndef GOOD
#define GOOD 20
#endif
#ifndef GUARD                        /* steps after which the guardian zeroes the device of a stopped process */
#define GUARD 1
#endif
#define FULL 2                       /* the whole force, in steps of the ramp */

#define MOST (LONGEST + (MUTANT == 23))
#define CAP (2 * LIMIT + MOST + ERROR + 1 + (MUTANT == 33 -> 4 * LIMIT : 0))      /* no age of an end is counted further */
#define CAP_LOOP (LIMIT + MOST + 1 + (MUTANT == 30 -> EXPIRE : 0))
#define OLDEST (WRAP + LIMIT + MOST + ERROR + 1)        /* age of a held datagram: older ones are all alike */
#define PERIOD(r) (4 * (LIMIT + (r)))           /* after which echoes repeat; 255/64 of the limit in the protocol */
#define TOO_OLD 255
#define DEAF 255
#define NEVER 255
#define MASTER 0
#define SLAVE 1

mtype = { CLOSED, SILENT, ENGAGED, LISTENING, CONNECTING, EMPTY, HELLO, WELCOME, SEALED };

/* Sessions: the one that the master is in, the one it calls for, and of those that it has left the one that the slave is
 * in, and the one that the slave has on paper. Nobody takes a datagram of any other. */
#define NONE 0
#define CURRENT 1
#define NEXT 2
#define FORMER 3
#define PAPER 4

typedef End {
    mtype state;
    byte session;                    /* NONE, CURRENT or FORMER */
    byte loop;                       /* time since the newest own datagram left that the peer is known to have heard */
    byte heard;                      /* time since the newest accepted datagram of the peer left: its true age */
    byte told;                       /* the same of the newest one that said whether its sender encodes */
    byte command;                    /* the same of the newest one that was sent while its sender encoded */
    byte quiet;                      /* time since anything fresh came */
    bool peer_encoding;              /* what that one said */
    byte gain;                       /* share of the force, or of the way to the commanded position, at the device */
    byte silent;                     /* since how many steps it has been silent */
    bool frozen;                     /* the ticks of the owner have stopped, while its event loop goes on */
    byte stopped;                    /* 0: the process runs; else since how many steps not */
    byte alone;
    byte opening;                    /* 1 + time since the session was opened, while no datagram of it is known to be heard */
    byte r;                          /* agreed round trip that this end uses now */
    byte other;                      /* that of the other generation: of the one before, or of the next one */
    bool odd;                        /* the present generation */
    bool noted;                      /* master: has proposed the next generation; slave: has accepted it */
    bool agreed;                     /* and may change to it */
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
    byte r;                          /* round trip that its sender used: the units of its echo */
    bool odd;                        /* generation */
    bool tells;                      /* whether it carries the first round trip */
    byte change;                     /* 1 + proposed round trip, or 1 + generation that is accepted; 0: none */
}

#define PLACES (SLOTS + 1)           /* the last place of a direction is for handshake datagrams */
End end[2];
Datagram held[2 * PLACES];
byte pending;                        /* slave: the session on paper, until its first sealed datagram has come */
byte paper;                          /* and the time since the HELLO that it is for came */
byte answer;                         /* slave: 1 + age of the HELLO to be answered; 0: none */
byte reply;                          /* slave: 1 + generation of the proposal to be answered; 0: none */
bool begun;                          /* the only session that the hostile channel gets, by SESSIONS */
bool unheard;                        /* master: has not heard the slave in the present session */
byte rest;                           /* master: time until it may propose; NEVER: the slave is not known to have changed */
bool whole;                          /* the channel is whole, for so many steps, with these delays */
byte good;
byte delay[2];
bool doubt;                          /* the clocks are mapped by the delays of before */
bool steady;                         /* the session has begun since then */

/* Chosen or used within a step, 0 between steps, so that they add no states. */
byte fate[2];                        /* of what is sent: 0 arrives, 1 is lost, 2 is held, 3 arrives and is held too */
byte release[2];                     /* 1 + place of the held datagram that arrives; 0: none */
byte where[2], woken[2];
bool bare[2];                        /* what is sent carries neither the round trip nor a change */
bool turns[2];                       /* changes the generation */
byte wish;                           /* 1 + round trip that the master proposes; 0: none */
byte who, k, kind, place, seem, echo, limit;
bool is_fresh, is_current, arrives;
byte name[5];
byte part;
Datagram d;

#define ROUND_TRIP (delay[0] + delay[1])
#if PROTOCOL == 0
#define IS_DRIVING(e) (end[e].state == ENGAGED && end[e].command != NEVER)
#define IS_LATE(e) (end[e].quiet > LIMIT)
#define IS_OVER(e) false
#define APART(e) end[e].quiet
#else
#if MUTANT == 2                      /* the loops look at the state alone */
#define IS_DRIVING(e) (end[e].state == ENGAGED && end[e].command != NEVER && end[e].opening == 0)
#elif MUTANT == 29                   /* an end drives while its session opens */
#define IS_DRIVING(e) (end[e].state == ENGAGED && end[e].peer_encoding)
#else
#define IS_DRIVING(e) (end[e].state == ENGAGED && end[e].peer_encoding && end[e].opening == 0)
#endif
#if MUTANT == 11    /* mutant 11: no limit of reception */
#define IS_LATE(e) (end[e].opening != 0 -> end[e].opening - 1 > LIMIT + end[e].r : end[e].loop > LIMIT + end[e].r)
#elif MUTANT == 10                   /* engaged while the other is heard */
#define IS_LATE(e) (end[e].quiet > LIMIT)
#elif MUTANT == 12                   /* the loop age must keep the limit of reception */
#define IS_LATE(e) (end[e].quiet > LIMIT || end[e].loop > LIMIT)
#else
#define IS_LATE(e) (end[e].opening != 0 -> end[e].opening - 1 > LIMIT + end[e].r : end[e].quiet > LIMIT || end[e].loop > LIMIT + end[e].r)
#endif
#if MUTANT == 3 || EXPIRE == 0       /* a session never ends by silence */
#define IS_OVER(e) false
#elif MUTANT == 30  /* it ends by its loop age alone */
#define IS_OVER(e) (end[e].loop > LIMIT + end[e].r + EXPIRE)
#else
#define IS_OVER(e) (end[e].silent > EXPIRE)
#endif
#if MUTANT == 31                     /* the fade does not allow for the round trip */
#define LATENESS(e) end[e].loop
#else
#define LATENESS(e) (end[e].loop > end[e].r -> end[e].loop - end[e].r : 0)
#endif
#define APART(e) (end[e].quiet > LATENESS(e) -> end[e].quiet : LATENESS(e))
#endif
#define RUNS_ENCODER(e) (end[e].state == ENGAGED && !end[e].frozen)
#if PROTOCOL == 0 || MUTANT == 1     /* the event loop says it without being told by the owner's tick */
#define IS_ENCODING(e) (end[e].state == ENGAGED)
#else
#define IS_ENCODING(e) RUNS_ENCODER(e)
#endif
#define NEGOTIATES(e) (end[e].state == ENGAGED)
#define IS_UP(e) (end[e].stopped == 0 && !end[e].frozen)
#define IS_THERE(e) (end[e].state == ENGAGED && IS_UP(e))
#define IS_CALLING ((end[MASTER].state == CONNECTING || end[MASTER].state == SILENT) && (SESSIONS == 0 || whole || !begun))

inline count(what, most) { what = (what < most -> what + 1 : most) }

inline forget(place) {
    held[place].kind = 0; held[place].session = 0; held[place].age = 0; held[place].echo = 0;
    held[place].encoding = 0; held[place].ran = 0; held[place].seen = 0; held[place].passed = 0;
    held[place].r = 0; held[place].odd = 0; held[place].tells = 0; held[place].change = 0
}

inline copy(target, source) {
    target.kind = source.kind; target.session = source.session; target.age = source.age; target.echo = source.echo;
    target.encoding = source.encoding; target.ran = source.ran; target.seen = source.seen; target.passed = source.passed;
    target.r = source.r; target.odd = source.odd; target.tells = source.tells; target.change = source.change
}

/* A session gets another name, by `name`. */
inline rename() {
    for (k : 0 .. 2 * PLACES - 1) { held[k].session = name[held[k].session] }
    end[SLAVE].session = name[end[SLAVE].session];
    pending = name[pending];
    if :: pending == NONE -> paper = 0; answer = 0 :: else fi;
    for (k : 0 .. 4) { name[k] = k }
    k = 0
}

/* The master leaves its session for another one, or for none. */
inline leave_session(next) {
    if
    :: end[SLAVE].session == CURRENT -> name[FORMER] = NONE; name[CURRENT] = FORMER
    :: end[SLAVE].session != CURRENT && pending == CURRENT -> name[PAPER] = NONE; name[CURRENT] = PAPER
    :: else -> name[CURRENT] = NONE
    fi;
    name[NEXT] = next;
    rename()
}

/* --- one end */

inline clear_session(e) {
    end[e].opening = 0; end[e].silent = 0; end[e].peer_encoding = 0; end[e].loop = CAP_LOOP; end[e].heard = CAP; end[e].told = LIMIT + MOST + 1; end[e].command = NEVER;
    end[e].r = 0; end[e].other = NEVER; end[e].odd = 0; end[e].noted = 0; end[e].agreed = 0;
    if :: e == MASTER -> rest = 0; unheard = 0 :: else -> reply = 0 fi
}

inline end_session(e) {
    end[e].session = NONE; end[e].quiet = LIMIT + 1;
    clear_session(e)
}

inline begin_session(e, named, first) {
    clear_session(e);
    end[e].session = named; end[e].state = ENGAGED; end[e].quiet = 0; end[e].gain = 0;
    end[e].r = first;
    end[e].opening = (PROTOCOL > 0 && 2 * first > LIMIT && MUTANT != 28)    /* mutant 28: no time for the first round trip */
}

inline run_timers(e) {
#if PROTOCOL > 0 && MUTANT != 9      /* mutant 9: a session on paper is kept for ever */
    if
    :: e == SLAVE && paper > LIMIT + (MUTANT == 27 -> 0 : LONGEST) -> pending = NONE; paper = 0; answer = 0     /* 27: kept for the limit of reception */
    :: else
    fi;
#endif
    if
    :: end[e].session == NONE
    :: end[e].session != NONE && IS_OVER(e) ->
        end_session(e);
        if
        :: e == MASTER -> leave_session(NONE); end[e].state = CONNECTING
        :: else -> end[e].state = LISTENING
        fi
    :: end[e].session != NONE && !IS_OVER(e) && end[e].state == ENGAGED && IS_LATE(e) ->
        end[e].state = SILENT; end[e].silent = (EXPIRE > 0);
        end[e].peer_encoding = (end[e].peer_encoding && (PROTOCOL == 0 || MUTANT == 35))      /* mutant 35: keeps what it has */
    :: else
    fi
}

inline hear_again(e) {
    if :: e == MASTER -> name[NEXT] = NONE; rename() :: else fi;            /* hangs up */
    end[e].state = ENGAGED; end[e].silent = 0
}

inline tick(e) {
    if
    :: !WATCHES(4) && !WATCHES(5)
    :: (WATCHES(4) || WATCHES(5)) && IS_DRIVING(e) && APART(e) < LIMIT ->
        end[e].gain = (end[e].gain < FULL -> end[e].gain + 1 : FULL);
        end[e].gain = (end[e].gain > LIMIT - APART(e) -> LIMIT - APART(e) : end[e].gain)
    :: else -> end[e].gain = 0
    fi
}

/* Time until nothing of the generation before the present one counts any more. */
#define REST (LIMIT + (end[MASTER].r > end[MASTER].other -> end[MASTER].r : end[MASTER].other) + 1)

/* The round trip of the next generation counts from now on. */
inline turn(e) {
    k = end[e].r; end[e].r = end[e].other; end[e].other = k; k = 0;
    end[e].odd = !end[e].odd; end[e].noted = 0; end[e].agreed = 0;
    if
    :: e != MASTER
    :: e == MASTER && MUTANT == 19 -> rest = 0                               /* mutant 19: may propose again at once */
    :: e == MASTER && MUTANT == 21 -> rest = REST                            /* 21: without having heard the slave */
    :: e == MASTER && MUTANT == 22 && rest != 0                              /* 22: counted from hearing it, before the own change */
    :: else -> rest = NEVER
    fi
}

/* Held datagrams of the session with a lower number have been overtaken. */
inline overtake(e) {
    for (k : (1 - (e)) * PLACES .. (1 - (e)) * PLACES + SLOTS - 1) {
        if
        :: held[k].kind == SEALED && held[k].session == d.session && held[k].age > d.age && held[k].passed == 0 && (WRAP > 0 || REPLAYS) ->
            held[k].passed = 1
        :: else
        fi
    }
    k = 0
}

/* A proposal comes to the slave, which changes at any time afterwards; or its answer to the master. */
inline take_change(e) {
    if
    :: e == SLAVE && d.odd == end[SLAVE].odd ->
        if
        :: !end[SLAVE].noted && d.change - 1 <= MOST ->
            end[SLAVE].noted = 1; end[SLAVE].agreed = 1; end[SLAVE].other = d.change - 1;
            reply = 1 + !d.odd
        :: end[SLAVE].noted && MUTANT != 32 -> reply = 1 + !d.odd               /* each repeat is answered again */
        :: else
        fi
    :: e == SLAVE && d.odd != end[SLAVE].odd && MUTANT != 32 -> reply = 1 + !d.odd      /* has changed already; 32: and does not say so */
    :: e == MASTER && end[MASTER].noted && d.change == 1 + !end[MASTER].odd -> end[MASTER].agreed = 1
    :: else
    fi
}

#if MUTANT == 16                     /* no generation in a datagram: its echo is read in the units of the reader */
#define UNITS(present, former, generation) present
#elif MUTANT == 17                   /* or in those that the reader has agreed on last */
#define UNITS(present, former, generation) (end[e].noted -> former : present)
#else
#define UNITS(present, former, generation) (d.odd == generation -> present : former)
#endif

/* Is a sealed datagram to be taken, by an end that uses this round trip, the other one and this generation? */
inline judge(e, present, former, generation) {
    limit = UNITS(present, former, generation);                              /* the smaller one of both ends */
    limit = (limit < present && MUTANT != 14 -> limit : present);            /* mutant 14: by the own round trip alone */
    seem = (WRAP > 0 && d.age >= WRAP -> d.age - WRAP : d.age);              /* its age as its stamp tells it */
#if PROTOCOL == 0
    is_fresh = (seem <= LIMIT + ERROR);
#else
    if
    :: !whole -> is_fresh = (seem <= LIMIT + (MUTANT == 13 -> (limit + 1) / 2 : limit) + ERROR)
    :: whole && doubt -> is_fresh = (2 * seem + delay[e] <= 2 * LIMIT + (MUTANT == 13 -> 0 : limit))
    :: else -> is_fresh = (2 * (seem - delay[1 - (e)]) + ROUND_TRIP <= 2 * LIMIT + (MUTANT == 13 -> 0 : limit))
    fi;
#endif
    if
    :: d.echo == DEAF -> echo = DEAF
    :: d.echo != DEAF && d.r == UNITS(present, former, generation) -> echo = d.echo % PERIOD(d.r)
    :: else -> echo = 0                                                     /* read in other units, it may be anything */
    fi;
    is_current = (echo != DEAF && echo <= LIMIT + (MUTANT == 15 -> limit : present));
    if :: d.seen && MUTANT != 4 -> is_fresh = 0 :: else fi;                  /* REPLAYED; mutant 4: no window */
#if PROTOCOL > 0
    if
    :: d.passed > LIMIT + 1 && MUTANT != 5 -> is_fresh = 0                   /* STALE by its number; mutant 5: not asked */
    :: else
    fi;
#endif
    seem = 0; limit = 0
}

/* A fresh datagram of this end's session. */
inline accept(e) {
    overtake(e);
    assert(!WATCHES(6) || !d.seen);
    assert(!WATCHES(9) || d.echo == DEAF || d.echo == echo);
    end[e].quiet = 0;
#if PROTOCOL > 0
    if :: echo != DEAF && echo < end[e].loop -> end[e].loop = echo :: else fi;
    if :: echo != DEAF && echo < end[e].opening -> end[e].opening = 0 :: else fi;
#endif
    if :: d.age < end[e].heard -> end[e].heard = d.age :: else fi;
    if
    :: d.encoding && !is_current && MUTANT != 6 && PROTOCOL > 0              /* STALE by its loop; mutant 6: not asked */
    :: else ->
        assert(!WATCHES(1) || !d.encoding || d.age <= LIMIT + end[e].r);
        if :: d.ran && d.age < end[e].command -> end[e].command = d.age :: else fi;
        if
        :: d.age < end[e].told || MUTANT == 7 -> end[e].told = d.age; end[e].peer_encoding = d.encoding
        :: else
        fi                                                                   /* mutant 7: by arrival, not by number */
    fi;
    if :: e == MASTER -> unheard = 0 :: else fi;
    if
    :: e == MASTER && rest == NEVER && d.odd == end[MASTER].odd ->
        rest = (MUTANT == 20 -> 0 : REST)                                    /* mutant 20: may propose as soon as it has heard it */
    :: MUTANT == 22 && e == MASTER && rest == 0 && end[MASTER].noted && d.odd != end[MASTER].odd -> rest = REST + 1
    :: else
    fi;
    if :: d.change != 0 && is_current -> take_change(e) :: else fi;
    if :: end[e].state == SILENT && !IS_LATE(e) -> hear_again(e) :: else fi
}

inline receive(e) {
    if
    :: d.kind == SEALED ->
        if
        :: d.session == end[e].session -> judge(e, end[e].r, end[e].other, end[e].odd)
        :: d.session != end[e].session && e == SLAVE && d.session == pending && (d.tells || MUTANT == 26) ->
            judge(SLAVE, d.r * d.tells, NEVER, 0);                           /* mutant 26: opened without the round trip */
            is_fresh = (is_fresh && is_current);
            if
            :: is_fresh ->
                begin_session(SLAVE, pending, d.r * d.tells);
                pending = NONE;
                if :: end[SLAVE].session == PAPER -> name[FORMER] = NONE; name[PAPER] = FORMER :: else fi;
                rename()
            :: else
            fi
        :: else
        fi;
        if :: is_fresh -> accept(e) :: else fi
    :: d.kind == HELLO && !d.seen && d.session == NEXT ->                    /* nobody can use the answer to any other */
        pending = NEXT; paper = 0; answer = 1 + d.age;
#if PROTOCOL > 0                     /* of a held HELLO the stamp is not above that of this one */
        if :: held[SLOTS].kind == HELLO && held[SLOTS].age >= d.age -> held[SLOTS].seen = 1 :: else fi
#endif
    :: d.kind == WELCOME && d.session == NEXT && MUTANT == 34 && d.echo > LONGEST && end[MASTER].session != NONE ->
        end[MASTER].state = CLOSED; end_session(MASTER)                      /* mutant 34: a path that is too long for a while ends it */
    :: d.kind == WELCOME && d.session == NEXT && IS_CALLING && (d.echo <= LONGEST || PROTOCOL == 0 || MUTANT == 25) ->
        leave_session(CURRENT);
        begin_session(MASTER, CURRENT, (PROTOCOL == 0 -> 0 : d.echo));
        end[MASTER].loop = d.echo; end[MASTER].heard = d.age; unheard = 1;
        doubt = 0; steady = (whole && good > d.echo); begun = SESSIONS
    :: else
    fi;
    echo = 0; is_fresh = 0; is_current = 0
}

/* --- the channel */

inline set(sort, named, with_echo) {
    d.kind = sort; d.session = named; d.age = 0; d.echo = with_echo
}

inline unset() {
    d.kind = 0; d.session = 0; d.age = 0; d.echo = 0; d.encoding = 0; d.ran = 0; d.seen = 0; d.passed = 0;
    d.r = 0; d.odd = 0; d.tells = 0; d.change = 0
}

inline send_sealed(e) {
    if
    :: end[e].stopped == 0 && end[e].session != NONE ->
        set(SEALED, end[e].session, end[e].heard);
        d.encoding = IS_ENCODING(e); d.ran = RUNS_ENCODER(e); d.r = end[e].r; d.odd = end[e].odd;
        if :: end[e].quiet > LIMIT && MUTANT != 33 -> d.echo = DEAF :: else fi;         /* mutant 33: repeats its echo for ever */
        if
        :: e == MASTER && !bare[e] ->
            d.tells = unheard;
            if
            :: NEGOTIATES(e) && end[e].noted && !end[e].agreed -> d.change = 1 + end[e].other
            :: else
            fi
        :: e == SLAVE && !bare[e] && NEGOTIATES(e) -> d.change = reply; reply = 0
        :: else
        fi;
        place = e * PLACES + where[e]
    :: else
    fi
}

inline send_handshake(e) {
    place = e * PLACES + SLOTS;
    if
    :: whole && held[place].kind != 0 ->                                     /* calls pause while one is under way */
        if :: e == SLAVE -> answer = 0 :: else fi
    :: !(whole && held[place].kind != 0) && e == MASTER && end[e].stopped == 0 && IS_CALLING -> set(HELLO, NEXT, DEAF)
    :: !(whole && held[place].kind != 0) && e == SLAVE && end[e].stopped == 0 && answer != 0 && pending == NEXT ->
        set(WELCOME, NEXT, answer - 1);
        answer = 0
    :: else
    fi
}

inline take_held(i) {
    copy(d, held[i]);
    if
    :: whole -> forget(i)
    :: else -> held[i].seen = (d.kind != WELCOME)
    fi
}

/* The channel does with what has been sent as it has chosen; what arrives at a process that is stopped waits there. The
 * whole channel delivers before anybody sends, the hostile one afterwards. */
#define IS_DUE(from, i) (held[(from) * PLACES + i].kind != 0 && held[(from) * PLACES + i].age >= delay[from])
inline pass(from, first, last) {
    for (kind : first .. last) {
        arrives = 1;
        if
        :: kind <= SLOTS && whole && IS_DUE(from, kind) -> take_held(from * PLACES + kind)
        :: kind == SLOTS + 1 || kind == SLOTS + 2 ->
            if
            :: whole && SLOTS > 1 ->
                k = 0;
                do
                :: k < SLOTS && held[from * PLACES + k].kind != 0 -> k++
                :: else -> break
                od;
                where[from] = (k < SLOTS -> k : 0);
                k = 0
            :: else
            fi;
            if
            :: kind == SLOTS + 1 -> send_sealed(from)
            :: else -> send_handshake(from)
            fi;
            arrives = (fate[from] == 0 || fate[from] == 3);
            if
            :: d.kind != 0 && (fate[from] >= 2 || (fate[from] == 0 && end[1 - from].stopped != 0)) ->    /* waits for the process */
                copy(held[place], d);
                held[place].seen = (fate[from] == 3 && d.kind != WELCOME)
            :: else
            fi;
            place = 0
        :: kind == SLOTS + 3 && release[from] != 0 -> take_held(from * PLACES + release[from] - 1)
        :: else
        fi;
        if :: d.kind != 0 && d.session != NONE && arrives && end[1 - from].stopped == 0 -> receive(1 - from) :: else fi;
        unset()
    }
    kind = 0; arrives = 0
}

inline age_end(e) {
    count(end[e].loop, CAP_LOOP); count(end[e].quiet, LIMIT + 1);
    count(end[e].heard, (end[e].quiet > LIMIT && MUTANT != 33 -> LIMIT + MOST + 1 : CAP));
    if :: end[e].state == SILENT && EXPIRE > 0 -> count(end[e].silent, EXPIRE + 1) :: else fi;
    count(end[e].told, LIMIT + MOST + 1);
    if :: end[e].opening != 0 -> count(end[e].opening, CAP) :: else fi;
    if :: end[e].command != NEVER -> count(end[e].command, CAP) :: else fi;
    if :: end[e].stopped != 0 -> count(end[e].stopped, LIMIT + 1) :: else fi
}

inline age_held() {
    for (k : 0 .. 2 * PLACES - 1) {
        if
        :: held[k].kind != 0 ->
            count(held[k].age, OLDEST);
            if :: held[k].echo != DEAF -> held[k].echo++ :: else fi;
            if :: held[k].passed != 0 -> count(held[k].passed, LIMIT + 2) :: else fi
        :: else
        fi
    }
    k = 0
}

/* A round trip that no datagram can refer to any more is forgotten, and the master's generation is always called even. */
inline simplify() {
    for (who : 0 .. 1) {
        if
        :: (end[who].session == NONE || end[who].noted || (who == MASTER && rest != 0)
            || (end[1 - who].session == end[who].session && end[1 - who].odd != end[who].odd))
        :: else ->
            k = (1 - who) * PLACES;
            do
            :: k < (1 - who) * PLACES + SLOTS && (held[k].kind == 0 || held[k].odd == end[who].odd) -> k++
            :: else -> break
            od;
            if :: k == (1 - who) * PLACES + SLOTS -> end[who].other = NEVER :: else fi
        fi
    }
    if
    :: end[MASTER].odd && !unheard ->
        for (k : 0 .. 2 * PLACES - 1) {
            if
            :: held[k].kind == SEALED && held[k].session == CURRENT ->
                held[k].odd = !held[k].odd;
                if :: k >= PLACES && held[k].change != 0 -> held[k].change = 3 - held[k].change :: else fi
            :: else
            fi
        }
        if
        :: end[SLAVE].session == CURRENT ->
            end[SLAVE].odd = !end[SLAVE].odd;
            if :: reply != 0 -> reply = 3 - reply :: else fi
        :: else
        fi;
        end[MASTER].odd = 0
    :: else
    fi;
    k = 0; who = 0
}

/* What nobody would take in any case is the same as nothing. */
inline sift() {
    for (k : 0 .. 1) {
        if :: !end[k].peer_encoding && PROTOCOL > 0 && MUTANT != 2 -> end[k].command = NEVER :: else fi
    }
    for (k : 0 .. 2 * PLACES - 1) {
        if
        :: held[k].kind == SEALED && (held[k].age >= OLDEST || held[k].session == NONE || (held[k].seen && !REPLAYS)
           || (held[k].passed > LIMIT + 1 && PROTOCOL > 0 && MUTANT != 5)
           || (k < PLACES && held[k].session != CURRENT && held[k].session != end[SLAVE].session && held[k].session != pending)
           || (k >= PLACES && held[k].session != CURRENT)) -> forget(k)
        :: (held[k].kind == HELLO || held[k].kind == WELCOME) && (held[k].session != NEXT || held[k].seen || held[k].age > CAP) -> forget(k)
        :: else
        fi
    }
#if SLOTS > 1                        /* the older one first */
    for (who : 0 .. SLOTS - 2) {
        for (k : 0 .. 2 * PLACES - 3) {
            if
            :: k % PLACES < SLOTS - 1 && held[k + 1].kind != 0 && (held[k].kind == 0 || held[k].age < held[k + 1].age) ->
                copy(d, held[k]); copy(held[k], held[k + 1]); copy(held[k + 1], d);
                unset()
            :: else
            fi
        }
    }
    who = 0;
#endif
    k = 0
}

#define BOUND(e) (LIMIT + (end[e].r < LONGEST -> end[e].r : LONGEST))

inline watch(e) {
    assert(!WATCHES(2) || !IS_UP(e) || !IS_DRIVING(e) || end[e].command <= BOUND(e));
    assert(!WATCHES(8) || !IS_UP(e) || !IS_DRIVING(e) || end[1 - (e)].session != end[e].session || end[1 - (e)].heard <= BOUND(e));
    assert(!WATCHES(8) || end[e].stopped != 0 || end[e].state != ENGAGED || end[e].opening != 0 || end[e].quiet <= LIMIT);
    if
    :: !IS_THERE(1 - e) && IS_UP(e) && ((WATCHES(3) && IS_DRIVING(e)) || (CHECK == 7 && IS_THERE(e))) ->
        end[e].alone++;
        assert(end[e].alone <= BOUND(e) + 1)
    :: else -> end[e].alone = 0
    fi;
    assert(!WATCHES(4) || !steady || LIMIT < 2 || end[e].session != CURRENT || end[e].state == ENGAGED);
    if
    :: WATCHES(5) ->
        assert(end[e].stopped <= LIMIT || end[e].gain == 0);                 /* it does not stand while the process stops */
        assert(woken[e] <= LIMIT || end[e].gain <= 1);                       /* and fades in afterwards */
        assert(!IS_UP(e) || IS_DRIVING(e) || end[e].gain == 0)     /* there is none without the peer */
    :: else
    fi
}

inline watch_channel() {
    if :: whole -> good++ :: else fi;
    if
    :: good < GOOD
    :: good >= GOOD && ROUND_TRIP <= LONGEST ->
        assert((IS_DRIVING(MASTER) && IS_DRIVING(SLAVE) && end[SLAVE].session == CURRENT
                && ((end[MASTER].r >= ROUND_TRIP && end[SLAVE].r >= ROUND_TRIP) || !CHANGES)
                && ((end[MASTER].gain > 0 && end[SLAVE].gain > 0) || end[MASTER].r < ROUND_TRIP || LIMIT < 2))
               || ROUND_TRIP == LIMIT + end[MASTER].r)
    :: good >= GOOD && ROUND_TRIP > LIMIT + LONGEST -> assert(!IS_DRIVING(MASTER) && !IS_DRIVING(SLAVE))
    :: else
    fi
}

inline guard(e) {
    skip;
#if PROTOCOL > 0 && MUTANT != 8                                              /* mutant 8: no guardian */
    if :: end[e].stopped > GUARD -> end[e].gain = 0 :: else fi
#endif
}

/* A line of the trace that `spin -t` shows. */
inline print_end(e) {
    printf("%d %e in %d: loop %d heard %d told %d command %d silent %d quiet %d peer encodes %d gain %d stopped %d alone %d opening %d R %d/%d odd %d noted %d agreed %d | sent %d released %d bare %d held %e age %d echo %d in %d passed %d R %d odd %d change %d\n",
        (e), end[e].state, end[e].session, end[e].loop, end[e].heard, end[e].told, end[e].command, end[e].silent, end[e].quiet, end[e].peer_encoding,
        end[e].gain, end[e].stopped, end[e].alone, end[e].opening, end[e].r, end[e].other, end[e].odd, end[e].noted, end[e].agreed,
        fate[e], release[e], bare[e], held[e * PLACES].kind, held[e * PLACES].age, held[e * PLACES].echo,
        held[e * PLACES].session, held[e * PLACES].passed, held[e * PLACES].r, held[e * PLACES].odd, held[e * PLACES].change);
    if
    :: e == SLAVE -> printf("- pending %d paper %d rest %d whole %d delays %d %d good %d doubt %d steady %d\n",
        pending, paper, rest, whole, delay[0], delay[1], good, doubt, steady)
    :: else
    fi
}

#define SHORTEST (ROUND_TRIP < LONGEST -> ROUND_TRIP : LONGEST)
#define MAY_CHANGE (NEGOTIATES(MASTER) && !end[MASTER].noted && rest == 0)
/* Never below half of the present one. Mutant 24: at once far down. */
#define MAY_PROPOSE(r0) (MAY_CHANGE && r0 <= MOST && r0 != end[MASTER].r && (2 * r0 >= end[MASTER].r || MUTANT == 24))

active proctype world() {
    d_step {
        end[MASTER].state = CONNECTING; end[SLAVE].state = LISTENING;
        for (who : 0 .. 1) { end_session(who) }
        who = 0;
        for (k : 0 .. 4) { name[k] = k }
        k = 0
    }
    do
    :: good < GOOD || !HOSTILE -> atomic {
        /* choose */
        if
        :: (HOSTILE || whole) && good < GOOD
        :: WATCHES(4) && (!whole || (!HOSTILE && good >= PACE)) ->
            whole = 1; good = 0; steady = 0;
            if :: doubt = 0 :: DELAY > 0 -> doubt = 1 fi;
            for (k : 0 .. 1) {
                if :: delay[k] = 0 :: DELAY > 0 -> delay[k] = 1 :: DELAY > 1 -> delay[k] = 2 :: DELAY > 2 -> delay[k] = 3 fi
            }
        fi;
        if
        :: whole ->
            for (k : 0 .. 1) {
                end[k].frozen = 0;
                woken[k] = end[k].stopped; end[k].stopped = 0;
                fate[k] = (delay[k] > 0 -> 2 : 0);
                turns[k] = end[k].agreed
            }
#if CHANGES
            if
            :: MAY_CHANGE && end[MASTER].r < SHORTEST -> wish = 1 + SHORTEST
            :: MAY_CHANGE && end[MASTER].r > SHORTEST && !HOSTILE -> wish = 1 + (2 * SHORTEST >= end[MASTER].r -> SHORTEST : (end[MASTER].r + 1) / 2)
            :: !(MAY_CHANGE && end[MASTER].r < SHORTEST)
            fi
#endif
        :: else ->
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
                :: WATCHES(4) || held[k * PLACES + SLOTS - 1].kind != 0 -> fate[k] = 1     /* else it can be held for ever as well */
                :: fate[k] = 2
                :: REPLAYS -> fate[k] = 3
                fi;
                if
                :: release[k] = 0
                :: held[k * PLACES].kind != 0 && end[1 - k].stopped == 0 -> release[k] = 1
                :: held[k * PLACES + SLOTS].kind != 0 && end[1 - k].stopped == 0 -> release[k] = SLOTS + 1
#if HOLDS > 1
                :: held[k * PLACES + 1].kind != 0 && end[1 - k].stopped == 0 -> release[k] = 2
                fi;
                if
                :: where[k] = 0
                :: fate[k] >= 2 && held[k * PLACES].kind != 0 -> where[k] = 1
#endif
                fi;
#if CHANGES
                if
                :: turns[k] = 0
                :: end[k].agreed -> turns[k] = 1
                fi;
#endif
                if
                :: bare[k] = 0
                :: fate[k] != 1 && ((k == MASTER && (unheard || (end[k].noted && !end[k].agreed))) || (k == SLAVE && reply != 0)) -> bare[k] = 1
                fi
            }
#if CHANGES
            if
            :: wish = 0
            :: MAY_PROPOSE(0) -> wish = 1
            :: MAY_PROPOSE(1) -> wish = 2
            :: MAY_PROPOSE(2) -> wish = 3
            :: MAY_PROPOSE(3) -> wish = 4
            :: MAY_PROPOSE(4) -> wish = 5
            fi
#endif
        fi;
        d_step {
            k = 0;
            age_held();
#if PROTOCOL > 0
            if :: pending != NONE -> count(paper, LIMIT + LONGEST + 1) :: else fi;
#endif
            if :: rest != 0 && rest != NEVER && !(MUTANT == 22 && rest == 1 && end[MASTER].noted) -> rest-- :: else fi;
            for (who : 0 .. 1) {
                age_end(who);
                if :: turns[who] -> turn(who) :: else fi
            }
            for (part : 0 .. 3) {
                if
                :: part == 2 && wish != 0 && NEGOTIATES(MASTER) && !end[MASTER].noted ->
                    end[MASTER].noted = 1; end[MASTER].other = wish - 1;
                    end[MASTER].agreed = (MUTANT == 18)                      /* mutant 18: changes without the answer */
                :: else
                fi;
                for (who : 0 .. 1) {
                    if
                    :: part == 0 || part == 2 -> pass(who, (part == 0 -> 0 : SLOTS + 1), (part == 0 -> SLOTS : SLOTS + 3))
                    :: (part == 1 || part == 3) && end[who].stopped == 0 ->
                        run_timers(who);
                        if :: part == 3 && !end[who].frozen -> tick(who) :: else fi
                    :: else
                    fi
                }
            }
            part = 0;
            for (who : 0 .. 1) { guard(who); print_end(who); watch(who) }
            watch_channel();
            who = 0;
            sift();
            simplify();
            fate[0] = 0; fate[1] = 0; release[0] = 0; release[1] = 0; where[0] = 0; where[1] = 0; woken[0] = 0; woken[1] = 0;
            bare[0] = 0; bare[1] = 0; turns[0] = 0; turns[1] = 0; wish = 0
        }
       }
    :: good >= GOOD && HOSTILE -> break
    od
}
