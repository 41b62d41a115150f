"""The words of column names, as data: what they mean, by meaning and language.

A meaning is a quantity, a part of the vehicle, a role, a side, or something that is none of the
channels. Bars divide languages: English, German, French, Spanish, Italian, Portuguese, Norwegian,
Chinese, Japanese, as far as there is a word of its own. Words are in small letters without accents,
the form in which names are compared; phrases are in quotation marks.
"""

# quantities that a channel, the time or the supply has
QUANTITIES = {
    "time": """time ts timestamp timestamps stamp clock epoch utc datetime elapsed unixtime timer
        itow "gps tow" hhmmss "of week" "of day" | zeit zeitstempel uhrzeit datum | temps heure
        horodatage | tiempo hora fecha "fecha y hora" | tempo ora orario | tempo | tid
        klokkeslett tidspunkt tidsstempel | 时间 時間 时间戳 | 時刻 日時""",
    "speed": """speed velocity velo vel spd | geschwindigkeit fahrt | vitesse | velocidad |
        velocita | velocidade | fart hastighet | 速度 航速 | 船速 速力""",
    "acceleration": """acceleration accel acc udot | beschleunigung | aceleracion |
        accelerazione | aceleracao | akselerasjon | 加速度""",
    "voltage": """voltage volt volts | spannung | tension | tension voltaje | tensione
        voltaggio | tensao voltagem | spenning | 电压 電壓 | 電圧""",
    "current": """current curr cur amp amps ampere amperes ampers amperage | strom stromstarke
        | courant intensite | corriente intensidad | corrente | corrente | strom stromstyrke |
        电流 電流""",
    "rpm": """rpm rps rev revs revolutions erpm "shaft speed" omega "rotational speed" |
        drehzahl umdrehungen upm | regime "vitesse de rotation" | revoluciones
        "velocidad de giro" | giri | rotacao rotacoes | turtall omdreininger | 转速 轉速 |
        回転数 回転速度""",
    "rudder": """rudder rud "delta r" | ruder ruderwinkel ruderlage | gouvernail safran |
        timon | timone | leme | ror rorvinkel | 舵 舵角 方向舵""",
    "stern_plane": """"stern plane" sternplane "stern planes" "stern elevator" elevator planes
        plane "delta s" | tiefenruder hohenruder | "barre de plongee" | dybderor | 升降舵
        水平舵 | 昇降舵""",
    "duty": """pwm throttle duty "duty cycle" dutycycle | tastgrad tastverhaltnis fahrhebel |
        gaz | acelerador | acceleratore | padrag gasspadrag | 油门 占空比 | スロットル
        デューティ""",
}
# what a word says beside the quantity
ROLES = {
    "command": """cmd command commanded setpoint "set point" set sp desired des reference ref
        demand demanded target goal next requested ordered order | soll sollwert vorgabe
        stellwert | consigne commande | consigna comando mando referencia | comando |
        referencia | settpunkt kommando onsket | 指令 目标 设定 设定值 命令 给定 | 目標 設定""",
    "mission": "mission | auftrag",
    "motor": """motor motors mot mtr engine thruster thrusters thr prop propeller screw shaft
        esc drive | antrieb welle wellen schraube | moteur helice arbre propulseur | eje
        propulsor | motore elica albero propulsore | eixo | propell aksel | 电机 電機 电动机
        推进器 螺旋桨 主机 | 主機 モータ モーター スラスタ スラスター プロペラ 推進器""",
    "supply": """battery batt bat bus supply pack input | batterie akku bordnetz bord
        versorgung | accumulateur alimentation | bateria alimentacion | batteria alimentazione
        | bateria | batteri forsyning | 电池 電池 母线 电源 | バッテリ バッテリー 電源""",
    "water": """water dvl stw log paddlewheel "paddle wheel" paddle "through water"
        "sea water" | "durchs wasser" wasser | eau loch | agua | acqua | vann | 对水 | 対水""",
    "ground": """ground sog gps gnss "over ground" "speed over ground" | "uber grund" grund
        grunn | "sur le fond" fond | "sobre fondo" fondo | 对地 | 対地""",
    "surge": "surge forward fwd longitudinal x ahead",
    "port": """port | backbord bb links | babord gauche | babor izquierda izquierdo | sinistra
        sinistro | bombordo esquerda esquerdo | babord venstre | left | 左 左舷 | 左舷""",
    "starboard": """starboard stbd starb | steuerbord stb rechts | tribord droite droit |
        estribor derecha derecho | dritta destra destro | estibordo boreste direita direito |
        styrbord hoyre | right | 右 右舷 | 右舷""",
    # a thruster at one of these places is on no side
    "place": """forward fwd fore aft bow stern front rear back top bottom upper lower vertical
        lateral | bug heck vorn hinten bugstrahlruder heckstrahlruder | proue poupe | proa
        popa | prua poppa | baug akter | 艏 艉 船首 船尾""",
    # words without a meaning of their own
    "plain": """vehicle sense sensed monitor monitored mon adc inst instantaneous now calc
        computed corrected smooth smoothed lpf sample logged main platform wrt imu ins ahrs
        ekf nav odom unix posix since start begin boat ship vessel auv rov usv asv robot body
        sensor data value values reading measured measurement meas actual act raw filtered
        filt est estimate estimated mean average avg of the in no nr draw feedback fb
        telemetry status output out channel ch hat fin angle | ist istwert gemessen messwert |
        mesure mesuree reel reelle de du la le | medida medido real del vehiculo | effettivo
        effettiva misura misurato di | medido do da | malt faktisk av farkost | 值 实际
        测量 角度 | 角 実測 値""",
}
# words of columns that are none of the channels, by what they are
OTHERS = {
    "sound": "sound acoustic | schall | son | sonido | suono | som | lyd | 声速 | 音速",
    "wind": "wind air | luft | vent | viento | vento | vind | 风速 风 | 風速 風",
    "the sea's current": """"sea current" tidal sea ocean "water current" "ocean current"
        "current dir" "current speed" "current direction" "current heading" "current velocity"
        "surface current" "bottom current" "water vx" "water vy" "water u" "water v" adcp drift
        tide | stromung | "courant marin" | "corriente marina" | "corrente marina" | havstrom |
        海流 潮流 水流 流速""",
    "sway, heave or turning": """sway heave yaw pitch roll gyro angular angvelo lateral
        vertical climb sink descent ascent cross transverse leeway z y vy vz ay az angrate
        turnrate rate | gieren rollen nicken | lacet tangage roulis | guinada cabeceo balanceo |
        imbardata beccheggio rollio | 航向 横摇 纵摇 | 方位""",
    "a direction or place": """heading hdg course cog psi phi theta depth altitude alt height
        range distance dist position pos latitude longitude lat lon lng north east ned enu
        easting northing direction dir bearing "vel n" "vel e" "vel d" "velocity n" "velocity e"
        "velocity d" | richtung kurs tiefe hohe entfernung | cap profondeur | rumbo direccion
        profundidad | rotta direzione profondita | rumo direcao profundidade | retning dybde |
        深度 经度 纬度 高度 | 深さ""",
    "a limit": """limit limits lim max maximum min minimum threshold thresh trip cutoff rated
        nominal | grenze grenzwert | limite | limite | grense | 限制 极限 | 制限""",
    "a setting": """zero "zero point" neutral trim bias calib calibration gain scale kp ki kd
        factor coeff config param parameter ratio deadband | nullpunkt | 零点""",
    "an error or a spread": """error err residual std stddev sigma var variance cov covariance
        rms noise uncertainty quality | fehler abweichung | erreur ecart | errore | erro |
        feil | 误差 | 誤差""",
    "a state": """flag flags mode state fault alarm warn warning valid enabled enable ok armed
        health | zustand fehlerstatus | etat | estado | stato | tilstand | 状态 | 状態""",
    "a count": """id index idx count counter step steps seq sequence wp waypoint row sample
        samples frame leg | schritt | etape | paso | passo | steg | 步 | 番号""",
    "a charge, an energy or a power": """charge charged energy power watt watts hour hours ah
        mah wh kwh consumed used total cumulative sum capacity soc coulomb remaining percent |
        leistung energie ladung verbraucht | puissance | potencia | potenza | effekt | 功率
        电量 | 電力""",
    "a force or a torque": """thrust torque force moment load lift | schub drehmoment kraft |
        poussee couple | empuje par | spinta coppia | empuxo | skyvekraft | 推力 转矩 扭矩 |
        トルク""",
    "a property of water or parts": """temperature temp pressure humidity leak salinity
        conductivity turbidity concentration oxygen chlorophyll fluorescence density ph ctd
        cell cells phase resistance impedance frequency freq weight mass ballast buoyancy vbd
        mag magnetometer | temperatur druck zelle | pression | presion | pressione | trykk |
        温度 压力 单体 相 | 圧力""",
    "another device": """pump fan winch generator alternator heater led lamp light lights
        strobe camera sonar payload computer cpu pc solar pv panel charger modem radio antenna
        servo servos gripper crane laser hotel house aux auxiliary instrument instruments
        electronics rail compressor valve steering chiller bilge trim flap | pumpe lufter
        heizung lichtmaschine | pompe ventilateur | bomba ventilador | ventola | pumpe vifte |
        水泵 泵 风扇 | ポンプ ファン""",
    "time that is left or counted otherwise": """timeout duration age uptime latency delay eta
        "time to" "time left" period interval dt deltat | dauer | duree | duracion | durata""",
}
# words of `OTHERS` that matter also where they stand in a group's name: wind/speed
GROUPS = ("sound", "wind", "the sea's current", "a limit", "a setting", "another device")
GROUP_WORDS = frozenset({"cell", "cells", "temperature", "position", "ned", "enu"})
# symbols of one letter and the like: quantity by itself, and with a side or a part of a shaft
SYMBOLS = {
    "t": ("time", None),
    "u": ("speed", "voltage"),
    "v": (None, "voltage"),
    "i": ("current", "current"),
    "n": ("rpm", "rpm"),
    "vx": ("speed", None),
    "ax": ("acceleration", None),
    "a": ("acceleration", None),
    "sec": ("time", None),
    "secs": ("time", None),
    "seconds": ("time", None),
    "date": ("time", None),
}
# words that say several things at once
JOINED = {
    "stw": ("speed", "water"),
    "sog": ("speed", "ground"),
    "fdw": ("speed", "water"),
    "fug": ("speed", "ground"),
    "vbat": ("supply", "voltage"),
    "vbatt": ("supply", "voltage"),
    "vbus": ("supply", "voltage"),
    "vin": ("supply", "voltage"),
    "ibat": ("supply", "current"),
    "ibatt": ("supply", "current"),
    "ibus": ("supply", "current"),
    "vel x": ("speed", "surge"),
    "linear x": ("speed", "surge"),
    "linear acceleration x": ("acceleration", "surge"),
    "speed through water": ("speed", "water"),
    "speed over ground": ("speed", "ground"),
}
# short marks of sides; they count where a column with the other one of the pair is in the log
SIDE_PAIRS = (
    ("p", "s"),
    ("ps", "sb"),
    ("l", "r"),
    ("lt", "rt"),
    ("bb", "sb"),
    ("bb", "tb"),
    ("bd", "td"),
    ("br", "er"),
    ("sx", "dx"),
    ("lh", "rh"),
    ("a", "b"),
)
