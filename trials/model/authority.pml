/* Who may drive whom: two masters, two slaves with the same key, and somebody between them who holds no key, but sees, keeps, drops,
 * repeats and redirects every datagram, for as long as it likes. README.md says what it shows and what it does not.
 *
 * There is no time here: an end may fall silent and a session may expire at any moment (link.pml says when they do). A session is known
 * by its slave, its master and the number of the HELLO that it answers: each HELLO has keys of its own, and a slave answers none twice.
 *
 * PROTOCOL  0: as of commit 3a86b41. 1: names, one master at a time, take_over, rising stamps
 * HELLOS    of each master
 * CHECK     1: no takeover that was not asked for; 2: no other slave; 3: nothing old is answered; 4: engaged again; 0: all
 * MUTANT    a fault put into protocol 1, by number
 */
#ifndef PROTOCOL
#define PROTOCOL 1
#endif
#ifndef MUTANT
#define MUTANT 0
#endif
#ifndef HELLOS
#define HELLOS 2
#endif
#ifndef CHECK
#define CHECK 0
#endif
#define WATCHES(property) (CHECK == 0 || CHECK == property)
#define NOBODY 2

mtype = { CLOSED, SILENT, ENGAGED, LISTENING, CONNECTING };

typedef Master {
    mtype state;
    bool take_over;                  /* the operator says so in every HELLO */
    byte called;                     /* number of its newest HELLO */
    byte slave, hello;               /* its session; NOBODY, 0 */
    byte expected;                   /* the slave that it is bound to, by the file or by its first session; NOBODY */
}
typedef Slave {
    mtype state;
    byte master, hello;              /* its session; NOBODY, 0 */
}
Master master[2];
Slave slave[2];

/* What was ever sent, and can be delivered at any time to anybody; by slave, master and number. */
#define AT(s, m, h) ((s) * 2 * (HELLOS + 2) + (m) * (HELLOS + 2) + (h))
#define ALL (4 * (HELLOS + 2))
bool welcome[ALL], refusal[ALL], sealed[ALL], bye[ALL];
byte paper[4];                       /* by slave and master: the HELLO for which there is a session on paper */
byte newest[4];                      /* by slave and master: the newest HELLO that was answered */
#define OF(s, m) ((s) * 2 + (m))

byte m, s, h;                        /* chosen in a step, 0 between steps */
bool was_busy;
bool calm;                           /* the channel is whole from now on, and nobody interferes */

#define IS_CALLING(m) (master[m].state == CONNECTING || master[m].state == SILENT)
#define IS_BUSY(s) (slave[s].state == ENGAGED || slave[s].state == SILENT)
#if MUTANT == 1                      /* a slave minds its session only while it hears the other */
#define MINDS(s) (slave[s].state == ENGAGED)
#else
#define MINDS(s) IS_BUSY(s)
#endif

inline call(m) { master[m].called++ }

inline leave_session(m) {
    master[m].slave = NOBODY; master[m].hello = 0
}

/* HELLO h of master m comes to slave s. */
inline hear_hello(s, m, h) {
    was_busy = IS_BUSY(s);
    if
#if PROTOCOL == 1 && MUTANT != 2     /* mutant 2: any HELLO that was not answered yet is good */
    :: h <= newest[OF(s, m)]                                                /* REPLAYED */
    :: h > newest[OF(s, m)] && MINDS(s) && slave[s].master != m && !(master[m].take_over) && MUTANT != 3 ->
        newest[OF(s, m)] = h;
        refusal[AT(s, m, h)] = true
#else
    :: welcome[AT(s, m, h)]                                                 /* each number is answered once */
#endif
    :: else ->
        assert(!WATCHES(3) || h > newest[OF(s, m)]);
        newest[OF(s, m)] = (h > newest[OF(s, m)] -> h : newest[OF(s, m)]);
        paper[OF(s, m)] = h;
        welcome[AT(s, m, h)] = true;
#if MUTANT == 4                      /* a HELLO with take_over ends the session at once, unconfirmed */
        if
        :: master[m].take_over && IS_BUSY(s) && slave[s].master != m -> slave[s].state = LISTENING; slave[s].master = NOBODY; slave[s].hello = 0
        :: else
        fi
#endif
    fi;
    assert(!WATCHES(3) || was_busy == IS_BUSY(s));                          /* a HELLO alone, which may be a recorded one, ends nothing */
    was_busy = false
}

/* The WELCOME of slave s to HELLO h comes to master m. */
inline hear_welcome(s, m, h) {
    if
#if PROTOCOL == 1 && MUTANT != 5     /* mutant 5: the slave's name is not compared */
    :: master[m].expected != NOBODY && master[m].expected != s -> master[m].state = CLOSED; leave_session(m)
#endif
    :: else ->
        assert(!WATCHES(2) || master[m].expected == NOBODY || master[m].expected == s);
        master[m].expected = s;
        master[m].state = ENGAGED; master[m].slave = s; master[m].hello = h;
        sealed[AT(s, m, h)] = true
    fi
}

/* A sealed datagram of the session of slave s, master m and HELLO h comes to the slave. */
inline hear_sealed(s, m, h) {
    if
    :: slave[s].master == m && slave[s].hello == h -> slave[s].state = ENGAGED
    :: !(slave[s].master == m && slave[s].hello == h) && paper[OF(s, m)] == h ->
        assert(!WATCHES(1) || !IS_BUSY(s) || slave[s].master == m || master[m].take_over);
        if
        :: IS_BUSY(s) && slave[s].master != m -> bye[AT(s, slave[s].master, slave[s].hello)] = true
        :: else
        fi;
        slave[s].state = ENGAGED; slave[s].master = m; slave[s].hello = h;
#if MUTANT != 6                      /* mutant 6: other sessions on paper outlive it */
        paper[OF(s, 1 - m)] = 0;
#endif
        paper[OF(s, m)] = 0
    :: else
    fi
}

inline free(s) { slave[s].state = LISTENING; slave[s].master = NOBODY; slave[s].hello = 0 }

/* What nobody would take in any case is the same as nothing. */
inline sift() {
    d_step {
        for (m : 0 .. 1) { for (s : 0 .. 1) { for (h : 1 .. HELLOS) {
            if
            :: !(IS_CALLING(m) && master[m].called <= h) -> refusal[AT(s, m, h)] = false; welcome[AT(s, m, h)] = (welcome[AT(s, m, h)] && PROTOCOL == 0)
            :: else
            fi;
            if :: paper[OF(s, m)] != h && !(slave[s].master == m && slave[s].hello == h) -> sealed[AT(s, m, h)] = false :: else fi;
            if :: !(master[m].slave == s && master[m].hello == h) -> bye[AT(s, m, h)] = false :: else fi;
            if
            :: PROTOCOL == 1 && paper[OF(s, m)] == h && !sealed[AT(s, m, h)] && !welcome[AT(s, m, h)] -> paper[OF(s, m)] = 0
            :: else
            fi;
            if
            :: master[m].state == CLOSED && PROTOCOL == 1 -> master[m].called = 0; newest[OF(s, m)] = 0; master[m].expected = 0
            :: else
            fi
        } } }
    }
}

inline choose() {
    if :: m = 0 :: m = 1 fi;
    if :: s = 0 :: s = 1 fi;
    if :: h = 1 :: h = 2 :: HELLOS > 2 -> h = 3 fi
}

/* What the channel, time and people may do, in any order. */
active proctype world() {
    atomic {
        master[0].state = CONNECTING; master[1].state = CONNECTING;
        slave[0].state = LISTENING; slave[1].state = LISTENING;
        master[0].slave = NOBODY; master[1].slave = NOBODY; slave[0].master = NOBODY; slave[1].master = NOBODY;
        if :: master[1].take_over = false :: master[1].take_over = true fi;   /* master 0 never says it */
        master[0].expected = 0;                                             /* named in its file */
        master[1].expected = NOBODY                                         /* bound by its first session */
    }
    do
    :: atomic { choose();
        if
        :: IS_CALLING(m) && master[m].called < HELLOS -> call(m)
        :: h <= master[m].called -> hear_hello(s, m, h)
        :: welcome[AT(s, m, h)] && IS_CALLING(m) && master[m].called == h -> hear_welcome(s, m, h)
        :: refusal[AT(s, m, h)] && IS_CALLING(m) && master[m].called == h -> master[m].state = CLOSED; leave_session(m)
        :: sealed[AT(s, m, h)] -> hear_sealed(s, m, h)
        :: bye[AT(s, m, h)] && master[m].slave == s && master[m].hello == h -> master[m].state = CLOSED; leave_session(m)
        :: master[m].state == ENGAGED -> master[m].state = SILENT
        :: master[m].state == SILENT && slave[s].master == m && master[m].slave == s && slave[s].hello == master[m].hello ->
            master[m].state = ENGAGED
        :: PROTOCOL == 1 && master[m].state == SILENT -> master[m].state = CONNECTING; leave_session(m)     /* SessionExpired */
        :: slave[s].state == ENGAGED -> slave[s].state = SILENT
        :: PROTOCOL == 1 && slave[s].state == SILENT && MUTANT != 7 -> free(s)                              /* SessionExpired */
        :: PROTOCOL == 1 && paper[OF(s, m)] != 0 -> paper[OF(s, m)] = 0                                     /* so do those on paper */
        :: master[m].slave == s && slave[s].master == m && slave[s].hello == master[m].hello ->             /* the operator leaves */
            master[m].state = CLOSED; leave_session(m); free(s)
        :: else
        fi;
        sift();
        m = 0; s = 0; h = 0 }
    :: WATCHES(4) -> break
    od;
    skip;
    /* From here on the channel is whole, and one master, the first that is left, calls the slave that it is bound to. */
    d_step {
        calm = true;
        m = (master[0].state != CLOSED -> 0 : 1);
        s = (master[m].expected == NOBODY -> 0 : master[m].expected);
        if
        :: master[m].state != CLOSED ->
            /* Within silence + 3 s the sessions that live on one side only are over, at both ends. */
            if
            :: PROTOCOL == 1 && MUTANT != 7 && IS_BUSY(s) && !(master[slave[s].master].slave == s && master[slave[s].master].hello == slave[s].hello) ->
                free(s)
            :: else
            fi;
            if
            :: PROTOCOL == 1 && master[m].slave != NOBODY && !(slave[s].master == m && slave[s].hello == master[m].hello) ->
                leave_session(m); master[m].state = CONNECTING
            :: else
            fi;
            if
            :: master[m].slave != NOBODY -> master[m].state = ENGAGED; slave[s].state = ENGAGED             /* heard again */
            :: else ->
                call(m); h = master[m].called;
                hear_hello(s, m, h);
                if :: welcome[AT(s, m, h)] -> hear_welcome(s, m, h); hear_sealed(s, m, h) :: else fi
            fi;
            /* Engaged, unless another master lives in a session with that slave. */
            assert((master[m].state == ENGAGED && master[m].slave == s && slave[s].state == ENGAGED && slave[s].master == m
                    && slave[s].hello == master[m].hello)
                   || (refusal[AT(s, m, h)] && master[slave[s].master].slave == s && slave[s].master != m))
        :: else
        fi;
        m = 0; s = 0; h = 0
    }
}
