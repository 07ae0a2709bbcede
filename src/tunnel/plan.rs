//! What the transport's tunnel is told: its two configuration files and its command line.

use std::ffi::OsString;

use magsteer_hal::channels::TunnelFacts;
use serde_json::{Value, json};

use super::address::Address;

/// The transport's configuration file, where the tunnel looks for it: below the folder in which it runs.
pub(super) const TRANSPORT_FILE: &str = "config/iceoryx2.toml";
/// The network's.
pub(super) const NETWORK_FILE: &str = "zenoh.json5";
/// Between two looks of the tunnel at the topics. A queue of cycles holds a second of a loop at 1 kHz, one of
/// the status three.
const POLL_MS: u32 = 20;
/// How long a message waits for a network that does not take it before it is dropped. While it waits the
/// others do too, in the queues above.
const NETWORK_WAIT_US: u32 = 100_000;
/// Buffers of 64 kB on their way into the network; a batch of cycles takes half of one.
const NETWORK_QUEUE: u32 = 16;
/// Between two attempts to reach the other side, at first and at most.
const RETRY_MS: [u32; 2] = [500, 2_000];

/// A side of the tunnel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Side {
    /// The rig's machine, where watching machines come to.
    Share {
        /// Where they come to.
        listen: Address,
    },
    /// A watching machine.
    Watch {
        /// Where the rig's machine is.
        connect: Address,
    },
}

/// A tunnel to be started.
#[derive(Debug, Clone)]
pub struct TunnelPlan {
    /// Name of the rig.
    pub rig: String,
    /// This machine's side.
    pub side: Side,
    /// What the transport has to know of the rig.
    pub facts: TunnelFacts,
}

impl TunnelPlan {
    /// Text of the network's configuration file.
    ///
    /// Nobody is looked for: the two sides meet at the address given and nowhere else.
    #[must_use]
    pub fn network_config(&self) -> String {
        let (listen, connect) = match &self.side {
            Side::Share { listen } => (vec![listen.locator()], vec![]),
            Side::Watch { connect } => (vec![], vec![connect.locator()]),
        };
        let [retry_init, retry_max] = RETRY_MS;
        let retry = json!({
            "period_init_ms": retry_init, "period_max_ms": retry_max, "period_increase_factor": 2,
        });
        let text = json!({
            "mode": "peer",
            "namespace": format!("magsteer/{}/{}", self.rig, self.facts.schema),
            "listen": {"endpoints": listen},
            // Tried for as long as it takes, in the background.
            "connect": {
                "endpoints": connect, "timeout_ms": -1, "exit_on_failure": false, "retry": retry,
            },
            "scouting": {"multicast": {"enabled": false}, "gossip": {"enabled": false}},
            "transport": {"link": {"tx": {"queue": {
                "size": {"data": NETWORK_QUEUE},
                "congestion_control": {"drop": {"wait_before_drop": NETWORK_WAIT_US}},
            }}}},
            "access_control": self.access(),
        });
        format!("{text:#}\n")
    }

    /// The network's access rules: data flow from the rig's machine alone. Each side keeps them for itself,
    /// so that the rig's need not trust the other's.
    fn access(&self) -> Value {
        let flow = match self.side {
            Side::Share { .. } => "ingress",
            Side::Watch { .. } => "egress",
        };
        json!({
            "enabled": true,
            "default_permission": "allow",
            "rules": [{
                "id": "towards-the-rig",
                "permission": "deny",
                "flows": [flow],
                // Data, and offers of topics.
                "messages": ["put", "delete", "reply", "liveliness_token"],
                "key_exprs": ["**"],
            }],
            "subjects": [{"id": "everybody"}],
            "policies": [{"rules": ["towards-the-rig"], "subjects": ["everybody"]}],
        })
    }

    /// The tunnel's arguments, run in the folder of its files. Every topic is named: without a name the
    /// tunnel would carry all.
    #[must_use]
    pub fn arguments(&self) -> Vec<OsString> {
        let poll = POLL_MS.to_string();
        let others = ["--zenoh-config", NETWORK_FILE, "--poll", poll.as_str()];
        let named = self.facts.services.iter().flat_map(|service| ["--allow", service.as_str()]);
        others.into_iter().chain(named).map(OsString::from).collect()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::{Side, TunnelFacts, TunnelPlan};

    fn plan(side: Side) -> TunnelPlan {
        let facts = TunnelFacts {
            transport_config: String::new(),
            services: ["magsteer/rig/status", "magsteer/rig/record"].map(str::to_owned),
            schema: "0123456789abcdef".to_owned(),
        };
        TunnelPlan { rig: "rig".to_owned(), side, facts }
    }

    fn both() -> [(Side, &'static str); 2] {
        let address = || "10.0.0.5:7447".parse().expect("an address");
        [(Side::Share { listen: address() }, "ingress"), (Side::Watch { connect: address() }, "egress")]
    }

    fn network(side: Side) -> Value {
        serde_json::from_str(&plan(side).network_config()).expect("JSON is JSON5")
    }

    #[test]
    fn tunnel_is_allowed_two_topics_by_name_and_nothing_else() {
        for (side, _) in both() {
            let arguments = plan(side).arguments();
            let words: Vec<&str> = arguments.iter().filter_map(|word| word.to_str()).collect();
            let allowed: Vec<&str> =
                words.windows(2).filter(|pair| pair[0] == "--allow").map(|pair| pair[1]).collect();
            assert_eq!(allowed, ["magsteer/rig/status", "magsteer/rig/record"], "{words:?}");
        }
    }

    /// Goal: whatever a watching machine sends, the rig's machine takes no data and no offer of a topic.
    #[test]
    fn each_side_lets_no_data_pass_towards_the_rig() {
        for (side, flow) in both() {
            let access = &network(side)["access_control"];
            assert_eq!(access["enabled"], json!(true));
            let rules = access["rules"].as_array().expect("rules");
            assert_eq!(rules.len(), 1);
            assert_eq!((&rules[0]["permission"], &rules[0]["flows"]), (&json!("deny"), &json!([flow])));
            assert_eq!(rules[0]["key_exprs"], json!(["**"]));
            let messages = rules[0]["messages"].as_array().expect("messages");
            assert!(
                ["put", "delete", "reply"].iter().all(|it| messages.contains(&json!(it))),
                "{messages:?}"
            );
            assert_eq!(access["policies"][0]["rules"][0], rules[0]["id"], "the rule is in force");
            assert_eq!(access["subjects"], json!([{"id": "everybody"}]), "for whoever comes");
        }
    }

    #[test]
    fn sides_meet_at_the_address_given_and_nobody_is_looked_for() {
        for (side, flow) in both() {
            let network = network(side);
            let at = |key: &str| network[key]["endpoints"].as_array().map(Vec::len);
            let expected = if flow == "ingress" { (Some(1), Some(0)) } else { (Some(0), Some(1)) };
            assert_eq!((at("listen"), at("connect")), expected);
            for scouting in ["multicast", "gossip"] {
                assert_eq!(network["scouting"][scouting]["enabled"], json!(false), "{scouting}");
            }
        }
    }

    #[test]
    fn builds_with_other_layouts_and_other_rigs_do_not_hear_each_other() {
        for (side, _) in both() {
            assert_eq!(network(side)["namespace"], json!("magsteer/rig/0123456789abcdef"));
        }
    }
}
